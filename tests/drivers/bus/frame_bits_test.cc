#include "drivers/bus/frame_bits.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

TEST_CASE("bits of a frame") {
  // DLC, standard nominal and worst, extended nominal and worst.
  const int table[][5] = {{0, 47, 55, 67, 80},    {1, 55, 65, 75, 90},     {4, 79, 95, 99, 120},
                          {6, 95, 115, 115, 140}, {7, 103, 125, 123, 150}, {8, 111, 135, 131, 160}};
  for (const auto& [length, nominal, worst, extended, extended_worst] : table) {
    CHECK(NominalBits(false, length) == nominal);
    CHECK(WorstCaseBits(false, length) == worst);
    CHECK(NominalBits(true, length) == extended);
    CHECK(WorstCaseBits(true, length) == extended_worst);
  }
}

TEST_CASE("bits of a frame of CAN FD, at either rate") {
  // By hand. Slow: start, id, RRS, IDE, FDF, res, BRS (extended: SRR and 18 of the id, too); CRC
  // delimiter, acknowledgement 2, end 7, interframe space 3. Fast: ESI, length 4, data, stuff count
  // 4, CRC 17 or 21, its stuff bits 6 or 7. At worst a stuff bit after each 4 up to the data's end.
  struct Row {
    bool extended;
    int length, slow, fast, worst_slow, worst_fast;
  };
  for (const Row& row : {Row{false, 0, 30, 32, 34, 33}, Row{false, 8, 30, 96, 34, 113},
                         Row{false, 16, 30, 160, 34, 193}, Row{false, 20, 30, 197, 34, 238},
                         Row{false, 32, 30, 293, 34, 358}, Row{false, 64, 30, 549, 34, 678},
                         Row{true, 48, 49, 421, 57, 519}}) {
    INFO(row.extended << " " << row.length);
    CHECK(NominalFdBits(row.extended, row.length).slow == row.slow);
    CHECK(NominalFdBits(row.extended, row.length).fast == row.fast);
    CHECK(WorstCaseFdBits(row.extended, row.length).slow == row.worst_slow);
    CHECK(WorstCaseFdBits(row.extended, row.length).fast == row.worst_fast);
  }
}

}  // namespace
}  // namespace plumb
