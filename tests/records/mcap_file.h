#pragma once

#include <zstd.h>

#include <boost/crc.hpp>
#include <catch2/catch.hpp>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// An MCAP file, read by what its specification says (https://mcap.dev/spec), independently of our
/// writer: by its summary's indexes alone. Requires that all of it is as it must be.
class McapFile {
 public:
  struct Schema {
    std::string name, encoding, data;
  };
  struct Channel {
    uint16_t schema;
    std::string topic, encoding;
  };
  struct Message {
    std::string topic;
    uint32_t sequence;
    uint64_t logged, published;
    std::string data;
  };

  explicit McapFile(std::string bytes) : bytes_(std::move(bytes)) {
    constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
    REQUIRE(bytes_.size() > 2 * kMagic.size() + 29);
    REQUIRE(bytes_.starts_with(kMagic));
    REQUIRE(bytes_.ends_with(kMagic));
    const size_t footer = bytes_.size() - kMagic.size() - 29;
    Reader at = Open(footer, 0x02);
    const auto summary = at.Number<uint64_t>(), offsets = at.Number<uint64_t>();
    CHECK(at.Number<uint32_t>() == Crc(std::string_view(bytes_).substr(
                                       summary, bytes_.size() - kMagic.size() - 4 - summary)));
    ReadSummary(summary, offsets);
    ReadOffsets(offsets, footer);
    // The data end right before the summary.
    Reader end = Open(summary - 13, 0x0f);
    CHECK(end.Number<uint32_t>() == Crc(std::string_view(bytes_).substr(0, summary - 13)));
  }

  std::map<uint16_t, Schema> schemas;
  std::map<uint16_t, Channel> channels;
  std::map<std::string, std::map<std::string, std::string>> metadata;
  std::vector<Message> messages;  // chunk after chunk, by the indexes
  uint32_t chunks = 0;

  std::vector<Message> Of(const std::string& topic) const {
    std::vector<Message> found;
    for (const Message& message : messages) {
      if (message.topic == topic) found.push_back(message);
    }
    return found;
  }

 private:
  /// Little-endian numbers and texts.
  struct Reader {
    std::string_view rest;
    template <class T>
    T Number() {
      T number;
      REQUIRE(rest.size() >= sizeof number);
      std::memcpy(&number, rest.data(), sizeof number);
      rest.remove_prefix(sizeof number);
      return number;
    }
    std::string_view Take(size_t size) {
      REQUIRE(rest.size() >= size);
      const std::string_view taken = rest.substr(0, size);
      rest.remove_prefix(size);
      return taken;
    }
    std::string Text() { return std::string(Take(Number<uint32_t>())); }
  };

  static uint32_t Crc(std::string_view bytes) {
    boost::crc_32_type crc;
    crc.process_bytes(bytes.data(), bytes.size());
    return crc.checksum();
  }
  static Reader OpenIn(std::string_view bytes, size_t at, uint8_t opcode) {
    REQUIRE(bytes.size() > at + 9);
    Reader record{bytes.substr(at)};
    REQUIRE(record.Number<uint8_t>() == opcode);
    const auto size = record.Number<uint64_t>();
    return {record.Take(size)};
  }
  Reader Open(size_t at, uint8_t opcode) const { return OpenIn(bytes_, at, opcode); }

  void ReadSummary(size_t begin, size_t end) {
    uint64_t told = 0;
    std::map<uint16_t, uint64_t> told_of;
    Reader records{std::string_view(bytes_).substr(begin, end - begin)};
    uint64_t first = 0, last = 0;
    while (!records.rest.empty()) {
      const auto opcode = records.Number<uint8_t>();
      Reader at{records.Take(records.Number<uint64_t>())};
      if (opcode == 0x03) {
        const auto id = at.Number<uint16_t>();
        schemas[id] = {at.Text(), at.Text(), at.Text()};
      } else if (opcode == 0x04) {
        const auto id = at.Number<uint16_t>(), schema = at.Number<uint16_t>();
        channels[id] = {schema, at.Text(), at.Text()};
        CHECK(schemas.contains(schema));
      } else if (opcode == 0x08) {
        ReadChunk(at);
      } else if (opcode == 0x0b) {
        told = at.Number<uint64_t>();
        CHECK(at.Number<uint16_t>() == schemas.size());
        CHECK(at.Number<uint32_t>() == channels.size());
        CHECK(at.Number<uint32_t>() == 0);
        at.Take(4);
        chunks = at.Number<uint32_t>();
        first = at.Number<uint64_t>(), last = at.Number<uint64_t>();
        Reader counts{at.Take(at.Number<uint32_t>())};
        while (!counts.rest.empty()) {
          const auto id = counts.Number<uint16_t>();
          told_of[id] = counts.Number<uint64_t>();
        }
      } else if (opcode == 0x0d) {
        ReadMetadata(at);
      } else {
        FAIL("opcode " << int{opcode});
      }
    }
    CHECK(messages.size() == told);
    for (const auto& [id, count] : told_of) CHECK(Of(channels.at(id).topic).size() >= count);
    for (const Message& message : messages) {
      CHECK(message.logged >= first);
      CHECK(message.logged <= last);
    }
  }

  void ReadMetadata(Reader index) {
    const auto offset = index.Number<uint64_t>(), size = index.Number<uint64_t>();
    const std::string name = index.Text();
    Reader at = Open(offset, 0x0c);
    CHECK(at.rest.size() + 9 == size);
    CHECK(at.Text() == name);
    Reader entries{at.Take(at.Number<uint32_t>())};
    while (!entries.rest.empty()) {
      const std::string key = entries.Text();
      metadata[name][key] = entries.Text();
    }
  }

  void ReadChunk(Reader index) {
    const auto first = index.Number<uint64_t>(), last = index.Number<uint64_t>(),
               start = index.Number<uint64_t>(), length = index.Number<uint64_t>();
    Reader offsets{index.Take(index.Number<uint32_t>())};
    const auto indexes = index.Number<uint64_t>();
    CHECK(index.Text() == "zstd");
    const auto compressed = index.Number<uint64_t>(), size = index.Number<uint64_t>();
    Reader chunk = Open(start, 0x06);
    CHECK(chunk.rest.size() + 9 == length);
    CHECK(chunk.Number<uint64_t>() == first);
    CHECK(chunk.Number<uint64_t>() == last);
    CHECK(chunk.Number<uint64_t>() == size);
    const auto crc = chunk.Number<uint32_t>();
    CHECK(chunk.Text() == "zstd");
    CHECK(chunk.Number<uint64_t>() == compressed);
    std::string records(size, '\0');
    REQUIRE(ZSTD_decompress(records.data(), size, chunk.rest.data(), compressed) == size);
    CHECK(Crc(records) == crc);
    uint64_t read = 0;
    while (!offsets.rest.empty()) {
      const auto id = offsets.Number<uint16_t>();
      Reader at = Open(offsets.Number<uint64_t>(), 0x07);
      read += at.rest.size() + 9;
      CHECK(at.Number<uint16_t>() == id);
      Reader entries{at.Take(at.Number<uint32_t>())};
      while (!entries.rest.empty()) {
        const auto logged = entries.Number<uint64_t>();
        Reader message = OpenIn(records, entries.Number<uint64_t>(), 0x05);
        REQUIRE(message.Number<uint16_t>() == id);
        Message found{channels.at(id).topic, message.Number<uint32_t>(), message.Number<uint64_t>(),
                      message.Number<uint64_t>(), ""};
        CHECK(found.logged == logged);
        CHECK(logged >= first);
        CHECK(logged <= last);
        found.data = message.rest;
        messages.push_back(found);
      }
    }
    CHECK(read == indexes);
  }

  void ReadOffsets(size_t begin, size_t end) const {
    Reader records{std::string_view(bytes_).substr(begin, end - begin)};
    while (!records.rest.empty()) {
      REQUIRE(records.Number<uint8_t>() == 0x0e);
      Reader at{records.Take(records.Number<uint64_t>())};
      const auto opcode = at.Number<uint8_t>();
      const auto start = at.Number<uint64_t>(), size = at.Number<uint64_t>();
      CHECK(static_cast<uint8_t>(bytes_.at(start)) == opcode);
      CHECK(start + size <= begin);
    }
  }

  const std::string bytes_;
};

}  // namespace plumb
