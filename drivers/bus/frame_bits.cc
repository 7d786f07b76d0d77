#include "drivers/bus/frame_bits.h"

namespace plumb {
namespace {

// From start of frame to the end of the CRC: what is stuffed, without the data.
constexpr int kStuffed = 34, kStuffedExtended = 54;
// CRC delimiter, acknowledgement, end of frame, interframe space.
constexpr int kUnstuffed = 13;

// Of CAN FD, as ISO 11898-1:2015 has it. From start of frame to the bit that says that the rate is
// switched: start 1, id 11, RRS, IDE, FDF, res, BRS; of an extended one SRR and 18 more bits of id.
constexpr int kSlowFd = 17, kSlowFdExtended = 36;
// ESI and the length's code, which are stuffed like the data behind them.
constexpr int kFastFd = 5;
// Stuff count 4 and CRC of 17 or, beyond 16 bytes, 21 bits, with a stuff bit before the first and
// behind each fourth of them, whatever they say.
constexpr int kShortCrcFd = 4 + 17 + 6, kLongCrcFd = 4 + 21 + 7;

}  // namespace

int NominalBits(bool extended, int length) {
  return (extended ? kStuffedExtended : kStuffed) + kUnstuffed + 8 * length;
}

int WorstCaseBits(bool extended, int length) {
  const int stuffed = (extended ? kStuffedExtended : kStuffed) + 8 * length;
  return stuffed + kUnstuffed + (stuffed - 1) / 4;
}

FdBits NominalFdBits(bool extended, int length) {
  return {(extended ? kSlowFdExtended : kSlowFd) + kUnstuffed,
          kFastFd + 8 * length + (length > 16 ? kLongCrcFd : kShortCrcFd)};
}

FdBits WorstCaseFdBits(bool extended, int length) {
  const int slow = extended ? kSlowFdExtended : kSlowFd, fast = kFastFd + 8 * length;
  // What is stuffed goes on across the switch of rates.
  const int all = (slow + fast - 1) / 4, before = (slow - 1) / 4;
  FdBits bits = NominalFdBits(extended, length);
  bits.slow += before;
  bits.fast += all - before;
  return bits;
}

}  // namespace plumb
