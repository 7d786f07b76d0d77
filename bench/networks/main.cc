// The trainer's kernels beside Eigen and, where it is installed, oneDNN: the networks and batches
// of robots/pendulum and robots/hopper, one thread, in one run. They take turns, so that whatever
// else the machine does meets all of them; times are medians, ratios medians of a turn's ratios.
//
//   OMP_NUM_THREADS=1 build/bench/networks [turns]      (oneDNN would use all processors)
//
// The last column is a hash of all results: the same for the same bits. What another processor
// would give: /lib64/ld-linux-x86-64.so.2 --glibc-hwcaps-mask x86-64-v3 build/bench/networks, and
// for oneDNN ONEDNN_MAX_CPU_ISA=AVX2 (none and SSE41 for the baseline).

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bench/networks/eigen_network.h"
#include "common/median.h"
#include "common/random.h"
#include "trainer/kernels/network.h"
#ifdef PLUMB_ONEDNN
#include "bench/networks/onednn_network.h"
#endif

namespace plumb::bench {
namespace {

constexpr int kGroup = 150;  // samples that BatchNetwork hands to the kernels at a time

std::vector<float> Normal(size_t count, double sd, Random& random) {
  std::vector<float> values(count);
  for (float& value : values) value = static_cast<float>(sd * random.Normal());
  return values;
}

/// The kernels, with the others' interface.
class Kernels {
 public:
  Kernels(std::span<const int> sizes, int columns)
      : network_(sizes), direction_(sizes), tape_(sizes, columns) {}
  void Set(std::span<const float> parameters) { network_.Set(parameters); }
  void SetDirection(std::span<const float> direction) { direction_.Set(direction); }
  void Forward(const float* inputs, int columns, float* outputs) {
    tape_.Forward(network_, inputs, columns, outputs);
  }
  void Tangent(float* tangent) { tape_.Tangent(network_, direction_, tangent); }
  void Backward(const float* output_gradient, float* gradient) {
    tape_.Backward(network_, output_gradient, gradient);
  }

 private:
  kernels::Network network_, direction_;
  kernels::Tape tape_;
};

/// One implementation at one size: the work that is timed, by name, and its results.
struct Candidate {
  std::string name;
  std::map<std::string, std::function<void()>> work;
  std::function<std::vector<float>()> results;
};

struct Problem {
  Problem(std::vector<int> network_sizes, int samples)
      : sizes(std::move(network_sizes)), columns(samples) {
    Random random(7);
    for (size_t l = 1; l < sizes.size(); ++l) {
      const auto in = static_cast<size_t>(sizes[l - 1]), out = static_cast<size_t>(sizes[l]);
      for (const float w : Normal(in * out, 1 / std::sqrt(in), random)) parameters.push_back(w);
      for (const float b : Normal(out, 0.1, random)) parameters.push_back(b);
    }
    direction = Normal(parameters.size(), 1, random);
    inputs = Normal(static_cast<size_t>(columns * sizes.front()), 1, random);
    output_gradient = Normal(static_cast<size_t>(columns * sizes.back()), 1, random);
  }
  std::vector<int> sizes;
  int columns;
  std::vector<float> parameters, direction, inputs, output_gradient;
};

template <class Network>
Candidate Make(const std::string& name, const Problem& p) {
  struct State {
    explicit State(const Problem& p)
        : network(p.sizes, p.columns),
          outputs(p.output_gradient.size()),
          tangent(outputs.size()),
          gradient(p.parameters.size()) {}
    Network network;
    std::vector<float> outputs, tangent, gradient;
  };
  const auto s = std::make_shared<State>(p);
  const auto forward = [s, &p] {
    s->network.Forward(p.inputs.data(), p.columns, s->outputs.data());
  };
  const auto backward = [s, &p] {
    s->network.Backward(p.output_gradient.data(), s->gradient.data());
  };
  const auto gauss_newton = [s] {
    s->network.Tangent(s->tangent.data());
    s->network.Backward(s->tangent.data(), s->gradient.data());
  };
  s->network.Set(p.parameters);
  s->network.SetDirection(p.direction);
  forward();
  return {name,
          {{"forward", forward},
           {"backward", backward},
           {"Gauss-Newton product", gauss_newton},
           {"new weights, forward, backward",
            [s, &p, forward, backward] {
              s->network.Set(p.parameters);
              forward();
              backward();
            }}},
          [s, forward, backward, gauss_newton] {
            forward();
            std::vector<float> all = s->outputs;
            for (const auto& part : {std::function<void()>(backward), {gauss_newton}}) {
              part();
              all.insert(all.end(), s->gradient.begin(), s->gradient.end());
            }
            return all;
          }};
}

/// Processor time [us] per call.
double Time(const std::function<void()>& work, int calls) {
  const std::clock_t begin = std::clock();
  for (int i = 0; i < calls; ++i) work();
  return 1e6 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC / calls;
}

double Difference(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0, scale = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    largest = std::max<double>(largest, std::abs(a[i] - b[i]));
    scale = std::max<double>(scale, std::abs(b[i]));
  }
  return largest / scale;
}

/// Whether a sample's outputs have the same bits however many others are evaluated with it. The
/// roll-outs need that: episodes are evaluated side by side, as many as happen to be under way.
template <class Network>
bool SameAmongOthers(const Problem& p) {
  const auto outputs = [&p](int columns) {
    Network network(p.sizes, columns);
    network.Set(p.parameters);
    std::vector<float> y(static_cast<size_t>(columns * p.sizes.back()));
    network.Forward(p.inputs.data(), columns, y.data());
    return y;
  };
  const std::vector<float> all = outputs(p.columns);
  for (int columns = 1; columns <= 8; ++columns) {
    const std::vector<float> some = outputs(columns);
    if (std::memcmp(some.data(), all.data(), some.size() * sizeof(float)) != 0) return false;
  }
  return true;
}

void Compare(const std::string& title, const Problem& problem, const std::vector<std::string>& what,
             int turns) {
  std::vector<Candidate> candidates{Make<Kernels>("kernels", problem),
                                    Make<EigenNetwork>("Eigen", problem)};
#ifdef PLUMB_ONEDNN
  candidates.push_back(Make<OnednnNetwork>("oneDNN", problem));
#endif
  const std::vector<float> expected = candidates.front().results();
  for (const std::string& part : what) {
    const int calls =
        std::max(1, static_cast<int>(1000 / Time(candidates.front().work.at(part), 10)));
    std::vector<std::vector<double>> times(candidates.size()), ratios(candidates.size());
    for (int turn = 0; turn < turns; ++turn) {
      for (size_t i = 0; i < candidates.size(); ++i)
        times[i].push_back(Time(candidates[i].work.at(part), calls));
      for (size_t i = 0; i < candidates.size(); ++i)
        ratios[i].push_back(times[i].back() / times[0].back());
    }
    for (size_t i = 0; i < candidates.size(); ++i) {
      const std::vector<float> results = candidates[i].results();
      const std::string_view bytes(reinterpret_cast<const char*>(results.data()),
                                   results.size() * sizeof(float));
      fmt::print("{:34}{:32}{:9}{:9.1f} us{:7.2f}   off by {:.0e}   {:016x}\n", title, part,
                 candidates[i].name, Median(times[i]), Median(ratios[i]),
                 Difference(results, expected), std::hash<std::string_view>()(bytes));
    }
  }
}

}  // namespace
}  // namespace plumb::bench

int main(int argc, char** argv) {
  using namespace plumb::bench;
  const int turns = argc > 1 ? std::atoi(argv[1]) : 200;
  fmt::print("{}\n", plumb::kernels::InstructionSet());
  const auto same = [](bool yes) { return yes ? "yes" : "no"; };
  for (const Problem& problem :
       {Problem({3, 128, 128, 1}, kGroup), Problem({11, 64, 64, 3}, kGroup)}) {
    fmt::print("a sample's bits are the same among any number of others: kernels {}, Eigen {}",
               same(SameAmongOthers<Kernels>(problem)),
               same(SameAmongOthers<EigenNetwork>(problem)));
#ifdef PLUMB_ONEDNN
    fmt::print(", oneDNN {}", same(SameAmongOthers<OnednnNetwork>(problem)));
#endif
    fmt::print("\n");
  }
  const std::vector<std::string> policy{"forward", "backward", "Gauss-Newton product"};
  const std::vector<std::string> critic{"new weights, forward, backward"};
  Compare("pendulum 3-128-128-1, 150", Problem({3, 128, 128, 1}, kGroup), policy, turns);
  Compare("pendulum's critic, 60", Problem({3, 128, 128, 1}, 60), critic, turns);
  Compare("hopper 11-64-64-3, 150", Problem({11, 64, 64, 3}, kGroup), policy, turns);
  Compare("hopper's critic 11-64-64-1, 64", Problem({11, 64, 64, 1}, 64), critic, turns);
}
