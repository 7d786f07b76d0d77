#include "trainer/past_trainings.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "common/hash.h"

namespace plumb {

std::filesystem::path PastTrainings::FileOf(int iteration) const {
  return folder_ / fmt::format("trainer_{}.checkpoint", iteration);
}

void PastTrainings::Begin(const TrainingSession& session) {
  statuses_.clear();
  past_.reset();
  const bool last = session.last();
  beginning_ = Hash(EncodeCheckpoint(session.MakeCheckpoint()), Hash(&last, sizeof last, run_));
  try {
    past_ = LoadCheckpoint(FileOf(session.iteration()).string());
  } catch (const CheckpointError& error) {  // it is trained again, and the file replaced
    spdlog::warn("{}: {}", FileOf(session.iteration()).string(), error.what());
  }
  const bool known = past_ && past_->identity == beginning_ && !past_->statuses.empty();
  if (!known) past_.reset();
}

std::optional<training_status_t> PastTrainings::Repeat(TrainingSession& session) {
  if (!past_) return {};
  const training_status_t status = past_->statuses[statuses_.size()];
  statuses_.push_back(status);
  if (statuses_.size() == past_->statuses.size()) {
    session.Restore(*past_);
    past_.reset();
  }
  return status;
}

Checkpoint PastTrainings::MakeCheckpoint(const TrainingSession& session) const {
  Checkpoint checkpoint = session.MakeCheckpoint();
  checkpoint.identity = beginning_;
  checkpoint.statuses = statuses_;
  return checkpoint;
}

void PastTrainings::Keep(const TrainingSession& session) const {
  SaveCheckpoint(FileOf(session.iteration()).string(), MakeCheckpoint(session));
}

}  // namespace plumb
