#include "firmware/record/take_numbers.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "firmware/storage/durable_file.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

void TakeNumbers::read_counter() {
  const auto text = disk_.read(kNextTakeFile, 64);
  counter_read_ = text || text.error().code == Errc::kNotFound ? Status() : fail(text.error());
  if (!text) return;
  std::uint64_t next = 0;
  const char* const begin = reinterpret_cast<const char*>(text->data());
  std::from_chars(begin, begin + text->size(), next);
  next_take_ = std::max(next_take_, std::min(next, kMax));
}

/// Also behind the takes that are beyond the list's limit, and behind what this program counted on other disks.
Result<std::uint64_t> TakeNumbers::new_number() {
  if (!counter_read_) return fail(counter_read_.error());  // a number could be used again
  const std::uint64_t number = std::max(next_take_, highest_ + 1);
  if (number >= kMax) {
    return fail(Errc::kTooLarge,
                fmt::format("the disk has a take with the number {}, the highest there may be; move its "
                            "folder away, and the file {}",
                            number, kNextTakeFile));
  }
  NODAL_TRY(write_durably(disk_, "", kNextTakeFile, std::to_string(number + 1)));
  next_take_ = number + 1;
  return number;
}

}  // namespace nodal::firmware
