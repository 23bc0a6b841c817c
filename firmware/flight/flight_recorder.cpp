#include "firmware/flight/flight_recorder.h"

#include <algorithm>
#include <utility>

#include "protocol/framing.h"

namespace nodal::firmware {
namespace {

std::vector<std::string> paths_of(const RigConfig& config) {
  std::vector<std::string> paths;
  for (const HeadConfig& head : config.heads) paths.push_back(head.port.text());
  return paths;
}

std::vector<std::uint8_t> framed(const take::flight::Record& record, std::uint32_t sequence) {
  const std::string payload = record.SerializeAsString();
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
  const auto head = encode_frame_header({FrameType::kTakeRecord, 0, 0, sequence}, bytes);
  std::vector<std::uint8_t> out(head.size() + bytes.size());
  std::ranges::copy(bytes, std::ranges::copy(head, out.begin()).out);
  return out;
}

constexpr std::uint32_t kVersion = 1;

}  // namespace

FlightRecorder::FlightRecorder(const RigConfig& config, hal::HeadEnumerator& heads, hal::TriggerPort* trigger)
    : events_(kEvents), heads_(heads, paths_of(config), *this) {
  if (trigger) trigger_.emplace(*trigger, *this);
}

void FlightRecorder::note(CaptureEvent&& event) {
  if (overrun_.load(std::memory_order_relaxed)) return;
  if (!events_.push(std::move(event))) overrun_.store(true, std::memory_order_release);
}

FlightLog::FlightLog(FlightRecorder& recorder, const std::string& software, std::size_t sets_held)
    : recorder_(recorder) {
  take::flight::Begin& begin = *open_.mutable_begin();
  begin.set_version(kVersion);
  begin.set_software(software);
  begin.set_sets_held(static_cast<std::uint32_t>(sets_held));
  begin.set_trigger(recorder.has_trigger());
}

void FlightLog::collect(Instant now) {
  const bool gap = recorder_.overrun();  // read first: the events from before the gap are in the ring then
  const bool wanted = in_take_ || dropped_ == 0;
  for (std::size_t taken = 0; taken < FlightRecorder::kEvents; ++taken) {
    const auto event = recorder_.next();
    if (!event) break;
    if (!wanted) continue;
    if (open_.events_size() == 0) opened_ = now;
    take::flight::Event& to = *open_.add_events();
    encoder_.encode(*event, to);
    open_bytes_ += to.ByteSizeLong() + 4;
    if (open_bytes_ >= kRecordBytes) close_record();
  }
  if (open_.events_size() > 0 && now - opened_ >= kRecordEvery) close_record();
  overrun_ = gap;
}

void FlightLog::close_record() {
  if (open_.events_size() == 0) return;
  records_.push_back(framed(open_, dropped_ + static_cast<std::uint32_t>(records_.size())));
  bytes_ += records_.back().size();
  open_.Clear();
  open_bytes_ = 0;
  while (bytes_ > kMax) {
    bytes_ -= records_.front().size();
    records_.pop_front();
    ++dropped_;
  }
}

bool FlightLog::begin() {
  next_ = 0;
  in_take_bytes_ = 0;
  in_take_ = dropped_ == 0 && !overrun_;
  return in_take_;
}

std::span<const std::uint8_t> FlightLog::next() {
  if (!in_take_ || next_ < dropped_ || next_ - dropped_ == records_.size() || in_take_bytes_ > kMaxInTake) return {};
  const std::vector<std::uint8_t>& record = records_[next_++ - dropped_];
  in_take_bytes_ += record.size();
  return record;
}

std::vector<std::uint8_t> FlightLog::end() {
  if (!std::exchange(in_take_, false)) return {};
  take::flight::Record last;
  const bool behind = next_ < dropped_;
  last.mutable_end()->set_reason(overrun_ || behind ? "events were lost: they came faster than the disk stored them"
                                 : in_take_bytes_ > kMaxInTake ? "it has the largest size that it may have"
                                                               : "the take ended");
  if (dropped_ > 0) {
    records_.clear();
    bytes_ = 0;
    open_.Clear();
    open_bytes_ = 0;
  }
  return framed(last, next_);
}

}  // namespace nodal::firmware
