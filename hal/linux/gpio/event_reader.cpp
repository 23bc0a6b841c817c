#include "hal/linux/gpio/event_reader.h"

#include "protocol/base/try.h"

namespace nodal::hal::gpio {

Result<std::size_t> EventReader::read() {
  const int count = line_->read_events(events_);
  if (count < 0) return fail(explain_use(name_, "reading", -count).in("trigger"));
  return static_cast<std::size_t>(count);
}

Status EventReader::discard() {
  left_ = 0;
  NODAL_TRY(read());
  return {};
}

Result<std::optional<LineEvent>> EventReader::next() {
  if (left_ == 0) {
    taken_ = 0;
    NODAL_TRY_ASSIGN(left_, read());
    // Before Linux 5.7 the timestamps are of the wall clock, which is decades ahead.
    constexpr Duration kDoubt = Duration::seconds(60);
    if (left_ > 0 && events_[0].at.ns() - kDoubt.ns() > system_.now().ns()) {
      return fail(Errc::kUnsupported, "trigger: line " + name_.text() +
                                          ": the kernel's timestamps are not of CLOCK_MONOTONIC; Linux 5.7 or newer is "
                                          "needed");
    }
  }
  if (left_ == 0) return std::optional<LineEvent>();
  --left_;
  return std::optional(events_[taken_++]);
}

}  // namespace nodal::hal::gpio
