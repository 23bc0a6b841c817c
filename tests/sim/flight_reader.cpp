#include "flight_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <variant>

#include "protocol/silence_protobuf.h"

namespace nodal::flight {

using firmware::CaptureEvent;
using firmware::StepBegun;

Result<FlightReader> FlightReader::open(std::span<const std::uint8_t> bytes, const std::string& name) {
  silence_protobuf();
  FlightReader reader(bytes, name);
  const auto first = reader.read_record();
  if (!first) return fail(first.error());
  if (!*first) return fail(Errc::kTruncated, name + ": not even its first record is whole");
  return reader;
}

Result<bool> FlightReader::read_record() {
  if (!ended_.empty() || rest_.empty()) return false;
  const auto frame = frames_.next(rest_);
  if (!frame || !*frame) {  // torn
    rest_ = {};
    return false;
  }
  take::flight::Record record;
  const auto payload = (*frame)->payload;
  const auto where = [&] { return fmt::format("{}: record {}", name_, frames_.frames() - 1); };
  if ((*frame)->header.type != FrameType::kTakeRecord || (*frame)->header.stream != 0 ||
      !record.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
    return fail(Errc::kBadFormat, where() + " is not one of a flight record");
  }
  if (const Status added = add(record); !added) return fail(added.error().in(where()));
  return true;
}

Status FlightReader::add(const take::flight::Record& record) {
  constexpr std::uint32_t kVersion = 1;
  if ((frames_.frames() == 1) != record.has_begin())
    return fail(Errc::kBadFormat, "a flight record has one begin, in its first record");
  if (record.has_begin()) {
    const take::flight::Begin& begin = record.begin();
    if (begin.version() > kVersion) {
      return fail(Errc::kFutureVersion,
                  fmt::format("version {} of flight records is newer than this program", begin.version()));
    }
    if (begin.version() == 0 || begin.sets_held() == 0 || begin.sets_held() > kMaxSetsHeld)
      return fail(Errc::kBadFormat, fmt::format("version {}, {} sets held", begin.version(), begin.sets_held()));
    begin_ = {begin.software(), begin.sets_held(), begin.trigger()};
  }
  for (const take::flight::Event& each : record.events()) {
    auto event = decoder_.decode(each);
    if (!event) return fail(event.error());
    events_.push_back(std::move(*event));
  }
  if (record.has_end()) ended_ = record.end().reason().empty() ? "it does not say why" : record.end().reason();
  return {};
}

Result<std::deque<CaptureEvent>> FlightReader::next_step() {
  const auto begins = [](const CaptureEvent& event) { return std::holds_alternative<StepBegun>(event); };
  std::size_t looked_at = 1;
  for (;;) {
    if (!events_.empty() && !begins(events_.front()))
      return fail(Errc::kBadFormat, name_ + ": an event before the first step");
    for (; looked_at < events_.size(); ++looked_at) {
      if (looked_at > kMaxEventsInStep) {
        return fail(Errc::kTooLarge, fmt::format("{}: a step with more than {} events", name_, kMaxEventsInStep));
      }
      if (!begins(events_[looked_at])) continue;
      const auto end = events_.begin() + static_cast<std::ptrdiff_t>(looked_at);
      std::deque<CaptureEvent> step(std::make_move_iterator(events_.begin()), std::make_move_iterator(end));
      events_.erase(events_.begin(), end);
      return step;
    }
    const auto more = read_record();
    if (!more) return fail(more.error());
    if (!*more) return std::deque<CaptureEvent>();
  }
}

}  // namespace nodal::flight
