#include "trainer/checkpoint.h"

#include <fmt/format.h>

#include <cerrno>
#include <concepts>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/atomic_file.h"
#include "common/checked_file.h"
#include "common/message_bytes.h"

namespace plumb {
namespace {

// Numbers as this machine has them: a checkpoint stays where it was written. Version 3: without
// trials on the robot, 4 to 6: with other residuals, 7: without the updates' statuses, 8: without
// what a decision owes to simulation, 9: without what the best policy's normaliser has seen,
// 10: with distributions that do not tell whether they explain the robot, and without the robot.
constexpr FileKind kKind{"PLUMBTRN", 11, "a trainer's checkpoint"};

class CheckpointWriter {
 public:
  template <class T>
  void operator()(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    Append(&value, sizeof value);
  }
  template <class Number>
  void operator()(const Eigen::VectorX<Number>& values) {
    (*this)(static_cast<uint64_t>(values.size()));
    Append(values.data(), static_cast<size_t>(values.size()) * sizeof(Number));
  }
  template <class Element>
  void Size(const std::vector<Element>& elements) {
    (*this)(static_cast<uint64_t>(elements.size()));
  }
  template <class Message>
  void EncodedMessage(const Message& message) {
    const std::vector<uint8_t> encoded = Encode(message);
    (*this)(static_cast<uint64_t>(encoded.size()));
    Append(encoded.data(), encoded.size());
  }
  const std::vector<char>& bytes() const { return bytes_; }

 private:
  void Append(const void* data, size_t size) {
    const auto* begin = static_cast<const char*>(data);
    bytes_.insert(bytes_.end(), begin, begin + size);
  }
  std::vector<char> bytes_;
};

class CheckpointReader {
 public:
  CheckpointReader(const char* data, size_t size) : next_(data), left_(size) {}

  template <class T>
  void operator()(T& value) {
    static_assert(std::is_arithmetic_v<T>);
    std::memcpy(&value, Take(sizeof value), sizeof value);
  }
  void operator()(bool& value) { value = *Take(1) != 0; }
  template <class Number>
  void operator()(Eigen::VectorX<Number>& values) {
    const size_t count = Count(sizeof(Number));
    values.resize(static_cast<Eigen::Index>(count));
    const char* const bytes = Take(count * sizeof(Number));
    if (count > 0) std::memcpy(values.data(), bytes, count * sizeof(Number));
  }
  template <class Element>
  void Size(std::vector<Element>& elements) {
    elements.resize(Count(1));
  }
  template <class Message>
  void EncodedMessage(Message& message) {
    const size_t size = Count(1);
    const auto* const bytes = reinterpret_cast<const uint8_t*>(Take(size));
    if (!Decode({bytes, size}, message)) {
      throw CheckpointError("holds a message that cannot be decoded");
    }
  }
  size_t left() const { return left_; }

 private:
  size_t Count(size_t element) {
    uint64_t count = 0;
    (*this)(count);
    if (count > left_ / element) throw CheckpointError("is too short");
    return count;
  }
  const char* Take(size_t size) {
    if (size > left_) throw CheckpointError("is too short");
    left_ -= size;
    return std::exchange(next_, next_ + size);
  }
  const char* next_;
  size_t left_;
};

template <class Archive, class C>
requires std::same_as<std::remove_const_t<C>, RunningMoments> ||
    std::same_as<std::remove_const_t<C>, ObservationMoments>
void Transfer(Archive& archive, C& moments) {
  archive(moments.count);
  archive(moments.mean);
  archive(moments.squares);
}

template <class Archive, class C>
requires std::same_as<std::remove_const_t<C>, CriticState>
void Transfer(Archive& archive, C& critic) {
  archive(critic.parameters);
  archive(critic.first_moment);
  archive(critic.second_moment);
  archive(critic.adam_steps);
  Transfer(archive, critic.targets);
}

template <class Archive, class C>
requires std::same_as<std::remove_const_t<C>, TriedPolicy>
void Transfer(Archive& archive, C& tried) {
  archive(tried.iteration);
  archive(tried.trial.steps);
  archive(tried.trial.sum_of_rewards);
  archive(tried.trial.late_rate);
  archive(tried.trial.fell);
}

template <class Archive, class C>
requires std::same_as<std::remove_const_t<C>, Acceptance::Decision>
void Transfer(Archive& archive, C& decision) {
  archive(decision.challenger);
  archive(decision.incumbent);
  archive(decision.accepted);
  archive(decision.trusted);
  archive(decision.probability);
  archive(decision.challenger_return);
  archive(decision.incumbent_return);
  // not simulated.difference_sd, which nobody is told
  archive(decision.simulated.challenger);
  archive(decision.simulated.incumbent);
}

/// The one list of what is in the file, for writing and reading.
template <class Archive, class C>
requires std::same_as<std::remove_const_t<C>, Checkpoint>
void Transfer(Archive& archive, C& checkpoint) {
  archive(checkpoint.seed);
  archive(checkpoint.robot);
  archive(checkpoint.identity);
  archive(checkpoint.updates);
  archive(checkpoint.steps);
  archive(checkpoint.dropped_episodes);
  archive(checkpoint.iteration);
  archive(checkpoint.iteration_updates);
  archive(checkpoint.complete);
  archive(checkpoint.evaluation.episodes);
  archive(checkpoint.evaluation.failed);
  archive(checkpoint.evaluation.mean);
  archive(checkpoint.evaluation.tenth);
  archive(checkpoint.evaluation.worst);
  archive(checkpoint.training_return);
  archive.EncodedMessage(checkpoint.policy);
  archive.EncodedMessage(checkpoint.distribution);
  Transfer(archive, checkpoint.critic);
  Transfer(archive, checkpoint.observations);
  archive.Size(checkpoint.trials);
  for (auto& tried : checkpoint.trials) Transfer(archive, tried);
  Transfer(archive, checkpoint.decision);
  archive(checkpoint.incumbent);
  archive(checkpoint.incumbent_since);
  if (checkpoint.incumbent >= 0) archive.EncodedMessage(checkpoint.incumbent_policy);
  archive.Size(checkpoint.statuses);
  for (auto& status : checkpoint.statuses) archive.EncodedMessage(status);
  archive(checkpoint.judged);
  if (!checkpoint.judged) return;
  archive.EncodedMessage(checkpoint.best_policy);
  Transfer(archive, checkpoint.best_critic);
  Transfer(archive, checkpoint.best_observations);
  archive(checkpoint.best_updates);
  archive(checkpoint.best_return);
}

}  // namespace

const policy_t& DeployedPolicy(const Checkpoint& checkpoint) {
  return checkpoint.incumbent >= 0 ? checkpoint.incumbent_policy : checkpoint.policy;
}

void RequireContinues(const Checkpoint& checkpoint, uint64_t robot, uint64_t seed, int iterations) {
  if (checkpoint.robot != robot) {
    throw CheckpointError(
        "the checkpoint is of another robot: robot.toml or its URDF has changed since");
  }
  if (checkpoint.seed != seed) {
    throw CheckpointError(
        fmt::format("the checkpoint is of a run with seed {}, not {}", checkpoint.seed, seed));
  }
  if (checkpoint.iteration < 0 || checkpoint.iteration > iterations) {
    throw CheckpointError(fmt::format("the checkpoint stands at iteration {}, beyond {}",
                                      checkpoint.iteration, iterations));
  }
}

TrainerState TrainerStateOf(const Checkpoint& checkpoint) {
  TrainerState state{GaussianPolicy::FromMessage(checkpoint.policy),
                     checkpoint.critic,
                     checkpoint.observations,
                     checkpoint.updates,
                     checkpoint.steps,
                     checkpoint.dropped_episodes};
  if (checkpoint.judged) {
    state.best =
        JudgedPolicy{GaussianPolicy::FromMessage(checkpoint.best_policy), checkpoint.best_critic,
                     checkpoint.best_updates, checkpoint.best_return, checkpoint.best_observations};
  }
  return state;
}

void SetTrainerState(const TrainerState& state, Checkpoint& checkpoint) {
  checkpoint.policy = state.policy.ToMessage(), checkpoint.critic = state.critic;
  checkpoint.observations = state.observations;
  checkpoint.updates = state.updates, checkpoint.steps = state.steps,
  checkpoint.dropped_episodes = state.dropped_episodes;
  checkpoint.judged = state.best.has_value();
  if (!state.best) return;
  checkpoint.best_policy = state.best->policy.ToMessage();
  checkpoint.best_critic = state.best->critic;
  checkpoint.best_observations = state.best->observations;
  checkpoint.best_updates = state.best->updates;
  checkpoint.best_return = state.best->mean_return;
}

std::string EncodeCheckpoint(const Checkpoint& checkpoint) {
  CheckpointWriter body;
  Transfer(body, checkpoint);
  return WithChecksum(kKind, {body.bytes().data(), body.bytes().size()});
}

Checkpoint DecodeCheckpoint(std::string_view bytes) {
  try {
    const std::string_view content = CheckedContent(kKind, bytes);
    CheckpointReader body(content.data(), content.size());
    Checkpoint checkpoint;
    Transfer(body, checkpoint);
    if (body.left() != 0) throw CheckpointError("is too long");
    return checkpoint;
  } catch (const DamagedFile& error) {
    throw CheckpointError(error.what());
  }
}

void SaveCheckpoint(const std::string& file, const Checkpoint& checkpoint) {
  const std::filesystem::path path = std::filesystem::absolute(file);
  std::error_code ignored;  // whatever is wrong with the folder, opening the file tells
  std::filesystem::create_directories(path.parent_path(), ignored);
  try {
    WriteAtomically(path, EncodeCheckpoint(checkpoint));
  } catch (const std::runtime_error& error) {
    throw CheckpointError(error.what());
  }
}

bool IsCheckpoint(std::string_view bytes) { return bytes.starts_with(kKind.magic); }

std::optional<Checkpoint> LoadCheckpoint(const std::string& file) {
  std::error_code ignored;  // whatever is wrong, opening the file tells
  const std::filesystem::file_status status = std::filesystem::status(file, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    // a pipe would keep us waiting
    throw CheckpointError(fmt::format("checkpoint {} is not a regular file", file));
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    if (status.type() == std::filesystem::file_type::not_found) return {};
    throw CheckpointError(fmt::format("cannot read checkpoint {}: {}", file, std::strerror(errno)));
  }
  const std::vector<char> bytes((std::istreambuf_iterator<char>(stream)),
                                std::istreambuf_iterator<char>());
  try {
    return DecodeCheckpoint({bytes.data(), bytes.size()});
  } catch (const CheckpointError& error) {
    throw CheckpointError(fmt::format("checkpoint {} {}", file, error.what()));
  }
}

}  // namespace plumb
