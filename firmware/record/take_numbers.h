// The numbers of takes: none is used twice.
#pragma once

#include <cstdint>
#include <string>

#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// A number is higher than all that this program has given, than the disk's counter, and than all takes on the disk.
///
/// Threading: thread-bound to the takes' stage, which blocks on the disk.
/// Ownership: the disk outlives it.
/// Errors: the disk's; kTooLarge when no number is left.
class TakeNumbers {
 public:
  explicit TakeNumbers(hal::DiskPort& disk) : disk_(disk) {}

  /// Reads the counter of the disk that is there.
  void read_counter();
  /// Highest number on the disk, also of takes that are not listed; 0: there is none.
  void set_highest(std::uint64_t number) { highest_ = number; }
  /// A number that no take has had. It is stored before it is used, so that it is never used again.
  Result<std::uint64_t> new_number();

  static constexpr std::uint64_t kMax = std::uint64_t{1} << 40;

 private:
  hal::DiskPort& disk_;
  Status counter_read_;  ///< result of reading kNextTakeFile
  std::uint64_t highest_ = 0;
  std::uint64_t next_take_ = 1;
};

/// A file in the root of the takes' disk with the number of the next take, so that no number is used twice.
inline const std::string kNextTakeFile = "next-take";

}  // namespace nodal::firmware
