#include "dashboard/derived.h"

#include <spdlog/spdlog.h>

#include <stdexcept>
#include <vector>

#include "dashboard/posterior_json.h"

namespace plumb {
namespace {

constexpr char kNumbers[] = R"({"type":"array","items":{"type":"number"}})";

std::string Schema(const std::string& title, const std::string& properties) {
  return R"({"$schema":"https://json-schema.org/draft/2020-12/schema","title":")" + title +
         R"(","type":"object","properties":{"utime":{"type":"integer"},)" + properties + "}}";
}

std::string PredictionSchema() {
  const std::string numbers = kNumbers;
  return Schema("plumb.prediction", R"("sequence":{"type":"integer"},"q":)" + numbers + R"(,"v":)" +
                                        numbers + R"(,"q_measured":)" + numbers);
}

// Without `samples` and `prior_samples`, which are lists of lists: neither Foxglove nor Lichtblick
// takes a schema with such, and either would show nothing of the topic.
std::string PosteriorSchema() {
  const std::string numbers = kNumbers;
  return Schema(
      "plumb.posterior",
      R"("iteration":{"type":"integer"},"parameters":{"type":"array","items":{"type":"object",)"
      R"("properties":{"name":{"type":"string"},"unit":{"type":"string"},"mean":{"type":"number"},)"
      R"("sd":{"type":"number"},"quantiles":)" +
          numbers +
          R"(,"prior_mean":{"type":"number"},"prior_sd":{"type":"number"},)"
          R"("determined":{"type":"boolean"}}}})");
}

}  // namespace

Derived::Derived(const RobotDescription& robot, Topics& topics)
    : robot_(robot),
      prior_(ParameterDistribution::Prior(robot)),
      topics_(topics),
      predictions_(topics.Add("PLUMB_PREDICTION", "plumb.prediction", PredictionSchema(),
                              Topics::Keep::kNewest)),
      scenes_(topics.Add("PLUMB_SCENE", "foxglove.SceneUpdate", SceneUpdate::Schema(),
                         Topics::Keep::kNewest)),
      frames_(topics.Add("PLUMB_FRAME", "foxglove.FrameTransform", SceneUpdate::FrameSchema(),
                         Topics::Keep::kNewest)),
      posteriors_(topics.Add("PLUMB_POSTERIOR", "plumb.posterior", PosteriorSchema(),
                             Topics::Keep::kHistory)),
      scene_(robot) {
  try {
    prediction_.emplace(robot);
  } catch (const std::invalid_argument& error) {
    spdlog::warn("no predictions: {}", error.what());
  }
}

void Derived::OnState(const robot_state_t& state, int64_t utime, int64_t now) {
  if (prediction_) prediction_->OnState(state);
  const Eigen::VectorXd q =
      Eigen::VectorXd::Map(state.q.data(), static_cast<Eigen::Index>(state.q.size()));
  if (q.size() != robot_.num_positions() || !q.allFinite()) return;
  utime_ = utime;
  q_ = q;
  const bool sees = (topics_.watched(scenes_) || topics_.watched(frames_)) && now >= next_scene_;
  const bool compares = topics_.watched(predictions_) && now >= next_prediction_;
  if (!sees && !compares) return;
  const auto predicted = prediction_ ? prediction_->Predict() : std::nullopt;
  if (compares && predicted) {
    next_prediction_ = now + kPredictionPeriod;
    topics_.Publish(predictions_, utime, predicted->Json());
  }
  if (sees) {
    next_scene_ = now + kScenePeriod;
    if (topics_.watched(frames_)) topics_.Publish(frames_, utime, scene_.FrameJson(utime, q));
    if (topics_.watched(scenes_))
      topics_.Publish(scenes_, utime, scene_.Json(utime, q, predicted ? &predicted->q : nullptr));
  }
}

std::optional<Topics::Message> Derived::Newest(uint32_t topic) const {
  if (q_.size() == 0 || (topic != scenes_ && topic != frames_)) return std::nullopt;
  return Topics::Message{utime_,
                         topic == scenes_ ? scene_.Json(utime_, q_) : scene_.FrameJson(utime_, q_)};
}

void Derived::OnDistribution(const parameter_distribution_t& message, int64_t utime) {
  try {
    const auto distribution = ParameterDistribution::FromMessage(message, robot_);
    topics_.Publish(posteriors_, utime, PosteriorJson(distribution, prior_, message.utime),
                    History::Step{message.iteration, 0});
    if (prediction_) prediction_->SetParameters(distribution.Mean());
  } catch (const std::invalid_argument& error) {
    spdlog::warn("PARAMETER_DISTRIBUTION refused: {}", error.what());
  }
}

}  // namespace plumb
