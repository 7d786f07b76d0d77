#include "trainer/episode_record.h"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

namespace plumb {
namespace {

template <class Fields, class Record>
void ForFields(Fields& fields, Record& record) {
  fields.Do(record.observations);
  fields.Do(record.actions);
  fields.Do(record.rewards);
  fields.Do(record.final_observation);
  fields.Do(record.moments.count);
  fields.Do(record.moments.mean);
  fields.Do(record.moments.squares);
  fields.Do(record.sum);
  fields.Do(record.terminated);
  fields.Do(record.usable);
}

/// Between ranks of one run: bytes as they lie in memory, arrays with their length before them.
struct EpisodeWriter {
  std::vector<std::byte> bytes;

  void Append(const void* data, size_t size) {
    const auto* begin = static_cast<const std::byte*>(data);
    bytes.insert(bytes.end(), begin, begin + size);
  }
  template <class T>
  void Do(const T& field) {
    if constexpr (std::is_arithmetic_v<T>) {
      Append(&field, sizeof field);
    } else {
      Do(static_cast<int64_t>(field.size()));
      Append(field.data(), static_cast<size_t>(field.size()) * sizeof *field.data());
    }
  }
};

struct EpisodeReader {
  std::span<const std::byte> rest;

  void Take(void* data, size_t size) {
    if (size == 0) return;  // an empty array has no data
    std::memcpy(data, rest.data(), size);
    rest = rest.subspan(size);
  }
  template <class T>
  void Do(T& field) {
    if constexpr (std::is_arithmetic_v<T>) {
      Take(&field, sizeof field);
    } else {
      int64_t size;
      Do(size);
      field.resize(static_cast<decltype(field.size())>(size));
      Take(field.data(), static_cast<size_t>(size) * sizeof *field.data());
    }
  }
};

}  // namespace

std::vector<EpisodeRecord> Gather(const Ranks& ranks, std::vector<EpisodeRecord> mine) {
  if (ranks.size() == 1) return mine;
  EpisodeWriter writer;
  for (const EpisodeRecord& record : mine) ForFields(writer, record);
  const std::vector<std::byte> bytes = ranks.Concatenate(writer.bytes);
  std::vector<EpisodeRecord> all;
  for (EpisodeReader reader{bytes}; !reader.rest.empty();) ForFields(reader, all.emplace_back());
  return all;
}

}  // namespace plumb
