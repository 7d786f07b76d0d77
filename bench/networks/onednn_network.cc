#include "bench/networks/onednn_network.h"

#include <algorithm>
#include <oneapi/dnnl/dnnl.hpp>
#include <utility>
#include <vector>

namespace plumb::bench {
namespace {

using dnnl::memory;
using Forward_ = dnnl::inner_product_forward;
using BackwardData = dnnl::inner_product_backward_data;
using BackwardWeights = dnnl::inner_product_backward_weights;
using Tag = memory::format_tag;

memory::desc Describe(memory::dims dims, Tag tag) { return {dims, memory::data_type::f32, tag}; }

/// A copy into the layout that a primitive wants, if it is another.
struct Reordered {
  Reordered(const memory::desc& from, const memory::desc& to, const dnnl::engine& engine)
      : other(from, engine, nullptr), wanted(to, engine) {
    if (from != to) reorder = dnnl::reorder(other, wanted);
  }
  memory& Fill(dnnl::stream& stream, const float* data) {
    other.set_data_handle(const_cast<float*>(data));
    if (!reorder) {
      wanted.set_data_handle(const_cast<float*>(data));
    } else {
      reorder.execute(stream, other, wanted);
    }
    return wanted;
  }
  memory other, wanted;
  dnnl::reorder reorder;
};

}  // namespace

struct OnednnNetwork::Storage {
  struct Layer {
    int in, out;
    Forward_ activate;           // tanh(W x + b), or without tanh in the last
    Forward_ apply, apply_onto;  // V x + c; the same added to what is there
    dnnl::eltwise_backward derive;
    BackwardData backward_data;
    BackwardWeights backward_weights;
    Reordered weight, weight_onto, weight_back, direction;
    memory below, bias, zero_bias, direction_bias, activation, change, gradient, gradient_bias;
    memory::desc plain_gradient;
    dnnl::reorder gradient_out;
  };

  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream{engine};
  std::vector<Layer> layers;
};

OnednnNetwork::OnednnNetwork(std::span<const int> sizes, int columns)
    : storage_(std::make_unique<Storage>()) {
  Storage& s = *storage_;
  const auto kForward = dnnl::prop_kind::forward_training;
  for (size_t l = 1; l < sizes.size(); ++l) {
    const int in = sizes[l - 1], out = sizes[l];
    const auto x = Describe({columns, in}, Tag::nc), y = Describe({columns, out}, Tag::nc);
    const auto w = Describe({out, in}, Tag::io), any = Describe({out, in}, Tag::any);
    const auto b = Describe({out}, Tag::x);
    const Forward_::desc description(kForward, x, any, b, y);
    dnnl::post_ops tanh_after, sum_after;
    tanh_after.append_eltwise(1, dnnl::algorithm::eltwise_tanh, 0, 0);
    sum_after.append_sum(1);
    dnnl::primitive_attr with_tanh, with_sum;
    if (l + 1 < sizes.size()) with_tanh.set_post_ops(tanh_after);
    with_sum.set_post_ops(sum_after);
    const Forward_::primitive_desc activate(description, with_tanh, s.engine);
    const Forward_::primitive_desc apply(description, s.engine);
    const Forward_::primitive_desc onto(description, with_sum, s.engine);
    const dnnl::eltwise_forward::primitive_desc tanh(
        {kForward, dnnl::algorithm::eltwise_tanh_use_dst_for_bwd, y, 0, 0}, s.engine);
    const dnnl::eltwise_backward::primitive_desc derive(
        {dnnl::algorithm::eltwise_tanh_use_dst_for_bwd, y, y, 0, 0}, s.engine, tanh);
    const BackwardData::primitive_desc data({x, any, y}, s.engine, apply);
    const BackwardWeights::primitive_desc weights({x, any, b, y}, s.engine, apply);
    Storage::Layer layer{in,
                         out,
                         Forward_(activate),
                         Forward_(apply),
                         Forward_(onto),
                         dnnl::eltwise_backward(derive),
                         BackwardData(data),
                         BackwardWeights(weights),
                         {w, activate.weights_desc(), s.engine},
                         {w, onto.weights_desc(), s.engine},
                         {w, data.weights_desc(), s.engine},
                         {w, apply.weights_desc(), s.engine},
                         memory(x, s.engine, nullptr),
                         memory(b, s.engine),
                         memory(b, s.engine),
                         memory(b, s.engine),
                         memory(y, s.engine),
                         memory(y, s.engine),
                         memory(weights.diff_weights_desc(), s.engine),
                         memory(b, s.engine),
                         w,
                         {}};
    if (l > 1) layer.below = s.layers.back().activation;
    std::fill_n(static_cast<float*>(layer.zero_bias.get_data_handle()), out, 0.0f);
    layer.gradient_out = dnnl::reorder(layer.gradient, memory(w, s.engine, nullptr));
    s.layers.push_back(std::move(layer));
  }
}

OnednnNetwork::~OnednnNetwork() = default;

void OnednnNetwork::Set(std::span<const float> parameters) {
  Storage& s = *storage_;
  const float* next = parameters.data();
  for (Storage::Layer& layer : s.layers) {
    layer.weight.Fill(s.stream, next);
    layer.weight_onto.Fill(s.stream, next);
    layer.weight_back.Fill(s.stream, next);
    next += layer.in * layer.out;
    std::copy_n(next, layer.out, static_cast<float*>(layer.bias.get_data_handle()));
    next += layer.out;
  }
}

void OnednnNetwork::SetDirection(std::span<const float> direction) {
  Storage& s = *storage_;
  const float* next = direction.data();
  for (Storage::Layer& layer : s.layers) {
    layer.direction.Fill(s.stream, next);
    next += layer.in * layer.out;
    std::copy_n(next, layer.out, static_cast<float*>(layer.direction_bias.get_data_handle()));
    next += layer.out;
  }
}

void OnednnNetwork::Forward(const float* inputs, int columns, float* outputs) {
  Storage& s = *storage_;
  s.layers.front().below.set_data_handle(const_cast<float*>(inputs));
  for (Storage::Layer& layer : s.layers) {
    layer.activate.execute(s.stream, {{DNNL_ARG_SRC, layer.below},
                                      {DNNL_ARG_WEIGHTS, layer.weight.wanted},
                                      {DNNL_ARG_BIAS, layer.bias},
                                      {DNNL_ARG_DST, layer.activation}});
  }
  s.stream.wait();
  std::copy_n(static_cast<const float*>(s.layers.back().activation.get_data_handle()),
              columns * s.layers.back().out, outputs);
}

void OnednnNetwork::Tangent(float* tangent) {
  Storage& s = *storage_;
  for (size_t l = 0; l < s.layers.size(); ++l) {
    Storage::Layer& layer = s.layers[l];
    layer.apply.execute(s.stream, {{DNNL_ARG_SRC, layer.below},
                                   {DNNL_ARG_WEIGHTS, layer.direction.wanted},
                                   {DNNL_ARG_BIAS, layer.direction_bias},
                                   {DNNL_ARG_DST, layer.change}});
    if (l > 0) {
      layer.apply_onto.execute(s.stream, {{DNNL_ARG_SRC, s.layers[l - 1].change},
                                          {DNNL_ARG_WEIGHTS, layer.weight_onto.wanted},
                                          {DNNL_ARG_BIAS, layer.zero_bias},
                                          {DNNL_ARG_DST, layer.change}});
    }
    if (l + 1 < s.layers.size()) {
      layer.derive.execute(s.stream, {{DNNL_ARG_DST, layer.activation},
                                      {DNNL_ARG_DIFF_DST, layer.change},
                                      {DNNL_ARG_DIFF_SRC, layer.change}});
    }
  }
  s.stream.wait();
  const memory& last = s.layers.back().change;
  std::copy_n(static_cast<const float*>(last.get_data_handle()),
              last.get_desc().get_size() / sizeof(float), tangent);
}

void OnednnNetwork::Backward(const float* output_gradient, float* gradient) {
  Storage& s = *storage_;
  memory& last = s.layers.back().change;
  std::copy_n(output_gradient, last.get_desc().get_size() / sizeof(float),
              static_cast<float*>(last.get_data_handle()));
  for (size_t l = s.layers.size(); l-- > 0;) {
    Storage::Layer& layer = s.layers[l];
    layer.backward_weights.execute(s.stream, {{DNNL_ARG_SRC, layer.below},
                                              {DNNL_ARG_DIFF_DST, layer.change},
                                              {DNNL_ARG_DIFF_WEIGHTS, layer.gradient},
                                              {DNNL_ARG_DIFF_BIAS, layer.gradient_bias}});
    if (l == 0) break;
    layer.backward_data.execute(s.stream, {{DNNL_ARG_DIFF_DST, layer.change},
                                           {DNNL_ARG_WEIGHTS, layer.weight_back.wanted},
                                           {DNNL_ARG_DIFF_SRC, s.layers[l - 1].change}});
    s.layers[l - 1].derive.execute(s.stream, {{DNNL_ARG_DST, s.layers[l - 1].activation},
                                              {DNNL_ARG_DIFF_DST, s.layers[l - 1].change},
                                              {DNNL_ARG_DIFF_SRC, s.layers[l - 1].change}});
  }
  s.stream.wait();
  for (Storage::Layer& layer : s.layers) {
    memory to(layer.plain_gradient, s.engine, gradient);
    layer.gradient_out.execute(s.stream, layer.gradient, to);
    gradient += layer.in * layer.out;
    std::copy_n(static_cast<const float*>(layer.gradient_bias.get_data_handle()), layer.out,
                gradient);
    gradient += layer.out;
  }
  s.stream.wait();
}

}  // namespace plumb::bench
