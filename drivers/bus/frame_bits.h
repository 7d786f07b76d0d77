#pragma once

namespace plumb {

/// Bits of a classic frame, the 3 of the interframe space included.
/// @param length bytes of data; 0 for a remote frame. Functions here are thread-safe.
int NominalBits(bool extended, int length);
/// With the most stuff bits that there can be.
int WorstCaseBits(bool extended, int length);

/// Bits of a frame of CAN FD whose bit rate is switched.
struct FdBits {
  int slow;  ///< at the bus's bit rate, those of the interframe space included
  int fast;  ///< at that of the data
};
/// Without the stuff bits that depend on contents; those at fixed places are counted.
FdBits NominalFdBits(bool extended, int length);
/// With the most stuff bits that there can be.
FdBits WorstCaseFdBits(bool extended, int length);

}  // namespace plumb
