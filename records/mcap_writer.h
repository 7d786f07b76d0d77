#pragma once

#include <boost/crc.hpp>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/atomic_file.h"

namespace plumb {

/// Writes an MCAP file (https://mcap.dev/spec, version 0), as Foxglove, Lichtblick and PlotJuggler
/// open it: messages in chunks compressed by zstd, each with an index; a summary with statistics;
/// checksums of all of it. The file is there, whole, after Finish. Not thread-safe.
class McapWriter {
 public:
  /// @param library who writes it. @throws std::runtime_error naming the file, as all that follows,
  /// if it cannot be written.
  McapWriter(const std::filesystem::path& file, std::string_view library);

  /// @param encoding "jsonschema". @return its number, > 0.
  uint16_t AddSchema(std::string_view name, std::string_view encoding, std::string_view data);
  /// @param encoding of its messages, "json". @return its number. @throws std::length_error after
  /// 65536 of them.
  uint16_t AddChannel(std::string_view topic, uint16_t schema, std::string_view encoding);
  /// What people may want to know. @param name of the entries.
  void AddMetadata(std::string_view name, const std::map<std::string, std::string>& entries);
  /// @param logged, published [ns]
  void Write(uint16_t channel, uint64_t logged, uint64_t published, std::string_view data);
  void Finish();

  uint64_t messages() const { return messages_; }

 private:
  struct IndexEntry {
    uint64_t logged, offset;
  };
  struct Channel {
    std::string record;
    uint64_t messages = 0;
    std::vector<IndexEntry> index;  // of the chunk that is under way
  };
  struct Span {
    uint64_t first = UINT64_MAX, last = 0;  // [ns]
    void Add(uint64_t logged);
  };

  void Append(std::string_view bytes);
  void EndChunk();
  std::string Statistics() const;

  AtomicFile file_;
  uint64_t position_ = 0;
  boost::crc_32_type crc_;            // of all that has been written so far
  std::vector<std::string> schemas_;  // records
  std::string chunk_indexes_, metadata_indexes_;
  uint32_t chunks_ = 0, metadata_ = 0;
  std::vector<Channel> channels_;
  std::string chunk_;
  Span chunk_span_, span_;
  uint64_t messages_ = 0;
};

}  // namespace plumb
