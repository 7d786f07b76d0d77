// Somebody else's simulator, behind a real connection: a linear one, whose posterior is known.
#include "umbridge/remote_calibration.h"

#include <unistd.h>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <thread>

#include "http/client.h"
#include "http/http.h"
#include "umbridge/robot_models.h"
#include "umbridge/server.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

constexpr int kOutcomes = 300;
constexpr double kOutcomeNoise = 0.01;

/// A server in this process, on a port of its own.
class Serving {
 public:
  explicit Serving(std::vector<ServedModel> models, const std::string& address = "127.0.0.1")
      : server_({address, 0}, {}, std::move(models)) {
    REQUIRE(pipe(pipe_) == 0);
    thread_ = std::thread([this] { server_.Run(pipe_[0], [] { return true; }); });
  }
  ~Serving() {
    REQUIRE(write(pipe_[1], "x", 1) == 1);
    thread_.join();
    close(pipe_[1]);
  }
  std::string url() const { return server_.url(); }

 private:
  UmbridgeServer server_;
  int pipe_[2];
  std::thread thread_;
};

/// Answers one request, whatever it is.
class Saying {
 public:
  explicit Saying(const std::string& answer)
      : acceptor_(context_, {asio::ip::address_v4::loopback(), 0}), thread_([this, answer] {
          tcp::socket socket = acceptor_.accept();
          asio::read_until(socket, asio::dynamic_buffer(heard_), "\r\n\r\n");
          asio::write(socket, asio::buffer(answer));
        }) {}
  ~Saying() {
    if (thread_.joinable()) thread_.join();
  }
  std::string url() const { return "http://localhost:" + std::to_string(port()); }
  uint16_t port() const { return acceptor_.local_endpoint().port(); }
  const std::string& Heard() {
    thread_.join();
    return heard_;
  }

 private:
  asio::io_context context_;
  tcp::acceptor acceptor_;
  std::string heard_;
  std::thread thread_;
};

RobotDescription TwoMasses() {
  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/cartpole");
  robot.parameters = {{"mass/cart", "kg", ParameterDescription::Coordinate::kLinear, 1, 1},
                      {"mass/pole", "kg", ParameterDescription::Coordinate::kLinear, 1, 1}};
  robot.virtual_robot.hidden.clear();
  return robot;
}

/// Next states of a step are whatever this says, whatever the state.
VectorXd Linear(int step, const VectorXd& p) {
  return Eigen::Vector4d(p(0), p(1) * std::sin(step), p(0) * std::cos(2 * step), 0.3 * p(1));
}

/// Every beginning is exact, and the noise of the end known or not.
Log Record(const VectorXd& truth, bool noise_known) {
  Random random(5);
  Log log;
  log.rollouts.resize(1);
  const VectorXd zero = VectorXd::Zero(2),
                 sd = VectorXd::Constant(2, noise_known ? kOutcomeNoise : NAN);
  for (int step = 0; step < kOutcomes; ++step) {
    VectorXd next = Linear(step, truth);
    for (double& entry : next) entry += kOutcomeNoise * random.Normal();
    log.rollouts[0].transitions.push_back(
        {2 * step, zero, zero, next.head(2), next.tail(2), zero, zero, sd, sd, {{0.02, zero}}});
  }
  return log;
}

ServedModel NextStates(const std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>& spoil =
                           [](const Eigen::MatrixXd& m) { return m; }) {
  return {"next_states", 2, 4 * kOutcomes, [=](const Eigen::MatrixXd& parameters) {
            Eigen::MatrixXd outputs(4 * kOutcomes, parameters.cols());
            for (Eigen::Index j = 0; j < parameters.cols(); ++j)
              for (int step = 0; step < kOutcomes; ++step)
                outputs.col(j).segment(4 * step, 4) = Linear(step, parameters.col(j));
            return spoil(outputs);
          }};
}

}  // namespace

TEST_CASE("somebody else's linear model has the posterior of linear regression") {
  const bool known = GENERATE(true, false);
  INFO(known);
  const RobotDescription robot = TwoMasses();
  const Eigen::Vector2d truth(1.7, 0.6);
  const std::vector<Log> logs{Record(truth, known)};
  const Serving serving({NextStates()});
  RemoteModel model(serving.url(), "next_states", 2, NextStatesSize(robot, logs));
  const Findings found = CalibrateRemote(robot, logs, model, {});

  // Normal equations, the prior among them.
  Eigen::Matrix2d precision = Eigen::Matrix2d::Identity();
  Eigen::Vector2d weighted = Eigen::Vector2d::Ones();
  for (int step = 0; step < kOutcomes; ++step) {
    const Transition& t = logs[0].rollouts[0].transitions[static_cast<size_t>(step)];
    Eigen::Matrix<double, 4, 2> rows;
    rows << Linear(step, Eigen::Vector2d(1, 0)), Linear(step, Eigen::Vector2d(0, 1));
    VectorXd end(4);
    end << t.next_q, t.next_v;
    precision += rows.transpose() * rows / (kOutcomeNoise * kOutcomeNoise);
    weighted += rows.transpose() * end / (kOutcomeNoise * kOutcomeNoise);
  }
  const Eigen::Vector2d mean = precision.llt().solve(weighted);
  const Eigen::Matrix2d covariance = precision.inverse();
  REQUIRE(found.posterior.components.size() == 1);
  const Gaussian& posterior = found.posterior.components[0];
  for (Eigen::Index i = 0; i < 2; ++i) {
    const double sd = std::sqrt(covariance(i, i));
    // The noise's scale is estimated, of each coordinate on its own where it is not known.
    CHECK(std::abs(posterior.mean(i) - mean(i)) < 0.3 * sd);
    CHECK(std::sqrt(posterior.covariance(i, i)) == Approx(sd).epsilon(0.15));
  }
  CHECK(found.identifiability.summary == "every parameter is determined by this motion");
  CHECK(found.transitions == kOutcomes);
  CHECK_THAT(found.misspecification.summary, Catch::Contains("not judged"));
  CHECK(found.warnings.empty());
  if (known) {
    CHECK(found.discrepancy == Approx(1).epsilon(0.1));
  } else {
    CHECK(std::isnan(found.discrepancy));  // nobody knows the noise
  }
  for (const double sd : found.noise_sd) CHECK(sd == Approx(kOutcomeNoise).epsilon(0.15));
}

TEST_CASE("errors that are larger than the recorded noise are told") {
  const RobotDescription robot = TwoMasses();
  std::vector<Log> logs{Record(Eigen::Vector2d(1.7, 0.6), true)};
  for (Transition& t : logs[0].rollouts[0].transitions) t.next_q_sd /= 3, t.next_v_sd /= 3;
  const Serving serving({NextStates()});
  RemoteModel model(serving.url(), "next_states", 2, NextStatesSize(robot, logs));
  const Findings found = CalibrateRemote(robot, logs, model, {});
  CHECK(found.discrepancy == Approx(9).epsilon(0.1));
  for (const double sd : found.noise_sd) CHECK(sd == Approx(kOutcomeNoise).epsilon(0.15));
}

TEST_CASE("velocities that nobody has read are no end of a step for somebody else's model") {
  RobotDescription robot = TwoMasses();
  std::vector<Log> logs{Record(Eigen::Vector2d(1.7, 0.6), true)};
  logs[0].name = "swing.csv", logs[0].differenced = {"slider"};
  const Serving serving({NextStates()});
  RemoteModel model(serving.url(), "next_states", 2, NextStatesSize(robot, logs));
  CHECK_THROWS_WITH(
      CalibrateRemote(robot, logs, model, {}),
      Catch::StartsWith("swing.csv: nobody has read the velocities of slider, and a model of "));
  logs[0].differenced.clear(), robot.calibration.velocities = false;
  CHECK_THROWS_WITH(CalibrateRemote(robot, logs, model, {}), Catch::Contains("velocities of "));
  CHECK_THROWS_WITH(RobotModels(robot, logs, {}), Catch::Contains("a model that is served"));
}

TEST_CASE("what somebody else's model says against the prior is told") {
  const RobotDescription robot = TwoMasses();
  // ten and twelve of the prior's standard deviations from its mean
  const std::vector<Log> logs{Record(Eigen::Vector2d(11, -11), true)};
  const Serving serving({NextStates()});
  RemoteModel model(serving.url(), "next_states", 2, NextStatesSize(robot, logs));
  const Findings found = CalibrateRemote(robot, logs, model, {});
  REQUIRE(found.warnings.size() == 1);
  CHECK_THAT(found.warnings[0], Catch::Contains("log and prior contradict each other"));
}

TEST_CASE("a model that is not what it should be is refused in a line") {
  const RobotDescription robot = TwoMasses();
  const std::vector<Log> logs{Record(Eigen::Vector2d(1, 1), true)};
  const Eigen::Index size = NextStatesSize(robot, logs);
  REQUIRE(size == 4 * kOutcomes);
  using Catch::Contains;
  {
    const Serving serving({NextStates()});
    CHECK_THROWS_WITH(RemoteModel(serving.url(), "forward", 2, size), Contains("next_states"));
    CHECK_THROWS_WITH(RemoteModel(serving.url(), "next_states", 3, size),
                      Contains("inputSizes of next_states is [2], and not [3]"));
    CHECK_THROWS_WITH(RemoteModel(serving.url(), "next_states", 2, size + 4),
                      Contains("outputSizes"));
    CHECK_THROWS_WITH(PostHttp(serving.url(), "/InputSizes", R"({"name": "next_states"})", 3),
                      Contains("limit"));
  }
  {
    const Serving failing(
        {NextStates([](const Eigen::MatrixXd& m) -> Eigen::MatrixXd { return m * NAN; })});
    RemoteModel model(failing.url(), "next_states", 2, size);
    CHECK_THROWS_WITH(CalibrateRemote(robot, logs, model, {}), Contains("no finite numbers"));
  }
  for (const double absurd : {1e150, -1e200}) {
    const Serving mad({NextStates([=](const Eigen::MatrixXd& m) -> Eigen::MatrixXd {
      return Eigen::MatrixXd::Constant(m.rows(), m.cols(), absurd);
    })});
    RemoteModel model(mad.url(), "next_states", 2, size);
    CHECK_THROWS_WITH(
        model.Evaluate(Eigen::MatrixXd::Ones(2, 1)),
        Catch::StartsWith(mad.url() + ": /Evaluate answers") && Contains("which no output is"));
  }
  for (const char* url :
       {"https://127.0.0.1:1", "127.0.0.1:1", "http://", "http://a:b", "http://:1", "http://a/b",
        "http://a b:1", "http://127.0.0.1:65537", "http://::1:1", "http://[::1]x:1"})
    CHECK_THROWS_WITH(RemoteModel(url, "next_states", 2, size), Contains("http://HOST:PORT"));
  // Port 1 of this machine: nobody is there.
  CHECK_THROWS_WITH(RemoteModel("http://127.0.0.1:1", "next_states", 2, size),
                    Contains("http://127.0.0.1:1/InputSizes: Connection refused"));
}

TEST_CASE("a request names the server as the user does") {
  Saying server("HTTP/1.1 200 OK\r\n\r\n{}");
  CHECK(PostHttp(server.url() + "/", "/Evaluate", "{}", 100).body == "{}");
  CHECK_THAT(server.Heard(),
             Catch::Contains("\r\nHost: localhost:" + std::to_string(server.port()) + "\r\n"));
  try {
    const Serving serving({NextStates()}, "::1");
    CHECK_THAT(serving.url(), Catch::StartsWith("http://[::1]:"));
    CHECK_NOTHROW(RemoteModel(serving.url(), "next_states", 2, 4 * kOutcomes));
  } catch (const std::runtime_error& error) {
    WARN("without IPv6: " << error.what());
  }
}

TEST_CASE("an answer of another status than success is an error, in its words or in ours") {
  const auto ask = [](const std::string& body) {
    const Saying server("HTTP/1.1 502 Bad Gateway\r\n\r\n" + body);
    RemoteModel(server.url(), "next_states", 2, 4);
  };
  CHECK_THROWS_WITH(ask(R"({"inputSizes": [2]})"),
                    Catch::EndsWith("/InputSizes is answered with status 502"));
  CHECK_THROWS_WITH(ask(R"({"error": {"type": "Gone", "message": "try later"}})"),
                    Catch::EndsWith("try later"));
}

TEST_CASE("who waits for a silent server may stop waiting") {
  struct Stopped {};
  asio::io_context context;
  const tcp::acceptor silent(context, {asio::ip::address_v4::loopback(), 0});
  int looks = 0;
  const auto look = [&] {
    if (++looks == 2) throw Stopped();
  };
  const std::string url = "http://127.0.0.1:" + std::to_string(silent.local_endpoint().port());
  CHECK_THROWS_AS(RemoteModel(url, "next_states", 2, 4, look), Stopped);
}

}  // namespace plumb
