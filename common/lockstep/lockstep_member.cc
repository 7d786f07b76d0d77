#include "common/lockstep/lockstep_member.h"

#include <algorithm>
#include <iterator>

namespace plumb {

int64_t LockstepMember::NextMoment() const {
  const int64_t arrival = wakes && !mail.empty() ? mail.front().arrival : kNever;
  return std::max(stalled_until, std::min(until, arrival));
}

void LockstepMember::Put(const lockstep_post_t& post) {
  auto place = mail.end();
  while (place != mail.begin() && std::prev(place)->arrival > post.arrival) --place;
  mail.insert(place, post);
}

}  // namespace plumb
