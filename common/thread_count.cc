#include "common/thread_count.h"

#include <algorithm>
#include <thread>

namespace plumb {

int ThreadCount(int asked, int ranks_here) {
  if (asked > 0) return asked;
  // 0 where the system does not say.
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / ranks_here);
}

}  // namespace plumb
