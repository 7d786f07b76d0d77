#include "records/mcap_writer.h"

#include <zstd.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
constexpr size_t kChunk = size_t{1} << 20;  // [bytes] before it is compressed

enum Opcode : uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunkRecord = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0b,
  kMetadata = 0x0c,
  kMetadataIndex = 0x0d,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f,
};

/// Little-endian numbers and texts, one after the other.
class Content {
 public:
  template <class Number>
  Content& Add(Number number) {
    for (size_t i = 0; i < sizeof number; ++i)
      bytes_ += static_cast<char>(static_cast<uint64_t>(number) >> (8 * i));
    return *this;
  }
  Content& Text(std::string_view text) {
    Add(static_cast<uint32_t>(text.size()));
    return Bytes(text);
  }
  Content& Bytes(std::string_view bytes) {
    bytes_ += bytes;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string Record(uint8_t opcode, std::string_view content) {
  return Content().Add(opcode).Add(uint64_t{content.size()}).Bytes(content).bytes();
}

uint32_t CrcOf(std::string_view bytes) {
  boost::crc_32_type crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return crc.checksum();
}

std::string Compressed(const std::string& bytes) {
  std::string compressed(ZSTD_compressBound(bytes.size()), '\0');
  const size_t size = ZSTD_compress(compressed.data(), compressed.size(), bytes.data(),
                                    bytes.size(), ZSTD_CLEVEL_DEFAULT);
  if (ZSTD_isError(size)) throw std::runtime_error(ZSTD_getErrorName(size));
  compressed.resize(size);
  return compressed;
}

}  // namespace

void McapWriter::Span::Add(uint64_t logged) {
  first = std::min(first, logged);
  last = std::max(last, logged);
}

McapWriter::McapWriter(const std::filesystem::path& file, std::string_view library) : file_(file) {
  Append(kMagic);
  Append(Record(kHeader, Content().Text("").Text(library).bytes()));
}

void McapWriter::Append(std::string_view bytes) {
  file_.Write(bytes);
  crc_.process_bytes(bytes.data(), bytes.size());
  position_ += bytes.size();
}

uint16_t McapWriter::AddSchema(std::string_view name, std::string_view encoding,
                               std::string_view data) {
  const auto id = static_cast<uint16_t>(schemas_.size() + 1);
  const Content content = Content().Add(id).Text(name).Text(encoding).Text(data);
  schemas_.push_back(Record(kSchema, content.bytes()));
  chunk_ += schemas_.back();
  return id;
}

uint16_t McapWriter::AddChannel(std::string_view topic, uint16_t schema,
                                std::string_view encoding) {
  if (channels_.size() > UINT16_MAX) throw std::length_error("more channels than MCAP can have");
  const auto id = static_cast<uint16_t>(channels_.size());
  const Content content = Content().Add(id).Add(schema).Text(topic).Text(encoding).Add(uint32_t{0});
  channels_.push_back({Record(kChannel, content.bytes()), 0, {}});
  chunk_ += channels_.back().record;
  return id;
}

void McapWriter::AddMetadata(std::string_view name,
                             const std::map<std::string, std::string>& entries) {
  Content map;
  for (const auto& [key, value] : entries) map.Text(key).Text(value);
  const std::string record = Record(kMetadata, Content().Text(name).Text(map.bytes()).bytes());
  const Content index = Content().Add(position_).Add(uint64_t{record.size()}).Text(name);
  metadata_indexes_ += Record(kMetadataIndex, index.bytes());
  ++metadata_;
  Append(record);
}

void McapWriter::Write(uint16_t channel, uint64_t logged, uint64_t published,
                       std::string_view data) {
  Channel& of = channels_.at(channel);
  of.index.push_back({logged, chunk_.size()});
  const auto sequence = static_cast<uint32_t>(of.messages++);
  chunk_ +=
      Record(kMessage,
             Content().Add(channel).Add(sequence).Add(logged).Add(published).Bytes(data).bytes());
  chunk_span_.Add(logged);
  span_.Add(logged);
  ++messages_;
  if (chunk_.size() >= kChunk) EndChunk();
}

void McapWriter::EndChunk() {
  if (chunk_.empty()) return;
  const bool any = chunk_span_.first <= chunk_span_.last;  // schemas alone have no times
  const uint64_t first = any ? chunk_span_.first : 0, last = chunk_span_.last;
  const std::string compressed = Compressed(chunk_);
  const uint64_t start = position_;
  Append(Record(kChunkRecord, Content()
                                  .Add(first)
                                  .Add(last)
                                  .Add(uint64_t{chunk_.size()})
                                  .Add(CrcOf(chunk_))
                                  .Text("zstd")
                                  .Add(uint64_t{compressed.size()})
                                  .Bytes(compressed)
                                  .bytes()));
  const uint64_t end = position_;
  Content offsets;
  for (size_t id = 0; id < channels_.size(); ++id) {
    std::vector<IndexEntry>& index = channels_[id].index;
    if (index.empty()) continue;
    std::ranges::stable_sort(index, {}, &IndexEntry::logged);
    offsets.Add(static_cast<uint16_t>(id)).Add(position_);
    Content entries;
    for (const IndexEntry& entry : index) entries.Add(entry.logged).Add(entry.offset);
    Append(Record(kMessageIndex,
                  Content().Add(static_cast<uint16_t>(id)).Text(entries.bytes()).bytes()));
    index.clear();
  }
  chunk_indexes_ += Record(kChunkIndex, Content()
                                            .Add(first)
                                            .Add(last)
                                            .Add(start)
                                            .Add(end - start)
                                            .Text(offsets.bytes())
                                            .Add(position_ - end)
                                            .Text("zstd")
                                            .Add(uint64_t{compressed.size()})
                                            .Add(uint64_t{chunk_.size()})
                                            .bytes());
  ++chunks_;
  chunk_.clear();
  chunk_span_ = {};
}

std::string McapWriter::Statistics() const {
  Content counts;
  for (size_t id = 0; id < channels_.size(); ++id)
    counts.Add(static_cast<uint16_t>(id)).Add(channels_[id].messages);
  return Record(kStatistics, Content()
                                 .Add(messages_)
                                 .Add(static_cast<uint16_t>(schemas_.size()))
                                 .Add(static_cast<uint32_t>(channels_.size()))
                                 .Add(uint32_t{0})  // attachments
                                 .Add(metadata_)
                                 .Add(chunks_)
                                 .Add(messages_ > 0 ? span_.first : uint64_t{0})
                                 .Add(span_.last)
                                 .Text(counts.bytes())
                                 .bytes());
}

void McapWriter::Finish() {
  EndChunk();
  Append(Record(kDataEnd, Content().Add(crc_.checksum()).bytes()));
  const uint64_t start = position_;
  std::string channels, schemas, summary, offsets;
  for (const std::string& schema : schemas_) schemas += schema;
  for (const Channel& channel : channels_) channels += channel.record;
  const auto add = [&](uint8_t opcode, const std::string& records) {
    if (records.empty()) return;
    const Content group =
        Content().Add(opcode).Add(start + summary.size()).Add(uint64_t{records.size()});
    offsets += Record(kSummaryOffset, group.bytes());
    summary += records;
  };
  add(kSchema, schemas);
  add(kChannel, channels);
  add(kStatistics, Statistics());
  add(kChunkIndex, chunk_indexes_);
  add(kMetadataIndex, metadata_indexes_);
  const uint64_t offsets_start = start + summary.size();
  summary += offsets;
  // The checksum is of all from the summary's beginning to where it stands itself.
  constexpr uint64_t kFooterSize = 20;
  summary += Content().Add(kFooter).Add(kFooterSize).Add(start).Add(offsets_start).bytes();
  Append(summary);
  Append(Content().Add(CrcOf(summary)).bytes());
  Append(kMagic);
  file_.Commit();
}

}  // namespace plumb
