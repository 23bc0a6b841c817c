#include "host_tool/web/metrics.h"

#include <fmt/format.h>

#include <string_view>
#include <utility>

namespace nodal::host::web {
namespace {

/// A label's value: a backslash, a quotation mark and an end of line are escaped.
std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    if (c == '\\' || c == '"') safe += '\\';
    if (c == '\n') safe += "\\n";
    else safe += c;
  }
  return safe;
}

/// Seconds with all digits of the nanoseconds.
std::string seconds(std::uint64_t ns) { return fmt::format("{}.{:09}", ns / 1'000'000'000, ns % 1'000'000'000); }
std::string seconds(std::int64_t ns) {
  return ns < 0 ? "-" + seconds(static_cast<std::uint64_t>(-ns)) : seconds(static_cast<std::uint64_t>(ns));
}

class Text {
 public:
  enum class Type : bool { kGauge, kCounter };
  /// Begins a metric.
  void begin(std::string_view name, Type type, std::string_view help) {
    name_ = name;
    text_ +=
        fmt::format("# HELP {} {}\n# TYPE {} {}\n", name, help, name, type == Type::kCounter ? "counter" : "gauge");
  }
  void value(std::string_view value) { add("", value); }
  void value(std::uint64_t number) { add("", std::to_string(number)); }
  void value(std::string_view label, std::string_view named, std::string_view value) {
    add(fmt::format("{{{}=\"{}\"}}", label, escaped(named)), value);
  }
  void gauge(std::string_view name, std::string_view help, std::string_view number) {
    begin(name, Type::kGauge, help);
    value(number);
  }
  void counter(std::string_view name, std::string_view help, std::uint64_t number) {
    begin(name, Type::kCounter, help);
    value(number);
  }
  std::string take() { return std::move(text_); }

 private:
  void add(const std::string& labels, std::string_view value) {
    if (series_ == kMaxSeries) return;
    ++series_;
    text_ += fmt::format("{}{} {}\n", name_, labels, value);
  }
  std::string text_;
  std::string_view name_;
  std::size_t series_ = 0;
};

using Type = Text::Type;

void add_counts(Text& text, std::string_view name, std::string_view help,
                const google::protobuf::RepeatedPtrField<wire::Count>& counts) {
  text.begin(name, Type::kCounter, help);
  for (const wire::Count& count : counts) text.value("reason", count.reason(), std::to_string(count.frames()));
}

void add_recording(Text& text, const wire::Recording& takes) {
  text.gauge("nodal_recording", "1 while a take is recorded.", takes.has_take() ? "1" : "0");
  text.gauge("nodal_recording_length_seconds", "Time since the take began.", seconds(takes.length_ns()));
  text.gauge("nodal_recording_lost_sets", "Sets of this take that were lost.", std::to_string(takes.lost_sets()));
  text.gauge("nodal_recording_buffer_ratio", "Used part of the memory for pictures on their way to the disk.",
             fmt::format("{}", takes.buffer_percent() / 100.0));
  text.gauge("nodal_disk_free_bytes", "Free bytes of the disk of the takes.", std::to_string(takes.free_bytes()));
  text.gauge("nodal_disk_size_bytes", "Size of the disk of the takes.", std::to_string(takes.total_bytes()));
}

void add_heads(Text& text, const wire::Heads& heads) {
  const auto each = [&](std::string_view name, Type type, std::string_view help, const auto& value) {
    text.begin(name, type, help);
    for (const wire::HeadState& head : heads.heads()) text.value("head", head.name(), value(head));
  };
  using Head = const wire::HeadState&;
  each("nodal_head_present", Type::kGauge, "1 if the head is there.",
       [](Head head) { return head.present() ? "1" : "0"; });
  each("nodal_head_frames_total", Type::kCounter, "Frames that the head delivered.",
       [](Head head) { return std::to_string(head.frames()); });
  each("nodal_head_lost_frames_total", Type::kCounter, "Frames of the head that are in no set.", [](Head head) {
    std::uint64_t lost = 0;
    for (const wire::Count& count : head.losses()) lost += count.frames();
    return std::to_string(lost);
  });
  each("nodal_head_missing_sets_total", Type::kCounter, "Sets without a frame of the head.",
       [](Head head) { return std::to_string(head.missing_sets()); });
  each("nodal_head_exposure_seconds", Type::kGauge, "Exposure of the newest frame.",
       [](Head head) { return seconds(head.exposure_ns()); });
  each("nodal_head_skew_seconds", Type::kGauge, "Mid-exposure of the newest frame against the median of its set.",
       [](Head head) { return seconds(std::int64_t{head.skew_ns()}); });
}

}  // namespace

std::string metrics_without_rig() {
  Text text;
  text.gauge("nodal_up", "1 if the rig answers.", "0");
  return text.take();
}

std::string metrics_text(const RigDesk::State& state) {
  const wire::RigStatus& status = state.status;
  Text text;
  text.gauge("nodal_up", "1 if the rig answers.", "1");
  text.begin("nodal_state", Type::kGauge, "1 for the state that the rig is in.");
  text.value("state", status.state(), "1");
  text.gauge("nodal_uptime_seconds", "Time since nodald started.", seconds(status.uptime_ns()));
  text.counter("nodal_frames_taken_total", "Frames of all heads: in sets, lost and held.", status.frames_taken());
  text.counter("nodal_frames_in_sets_total", "Frames that are part of a set.", status.frames_in_sets());
  text.gauge("nodal_frames_held", "Frames that wait in an unfinished set.", std::to_string(status.frames_held()));
  add_counts(text, "nodal_frames_lost_total", "Frames that are in no set, by reason.", status.losses());
  text.counter("nodal_sets_total", "Frame sets.", status.sets());
  text.counter("nodal_full_sets_total", "Frame sets with every head of the rig.", status.full_sets());
  add_counts(text, "nodal_sets_lost_total", "Sets that became no raymap, by reason.", status.set_losses());
  text.counter("nodal_raymaps_total", "Raymaps blended.", status.raymaps());
  text.counter("nodal_raymaps_published_total", "Raymaps given to at least one host.", status.published());
  text.counter("nodal_encode_failures_total", "Raymaps that could not be encoded.", status.encode_failures());
  text.gauge("nodal_raymap_rate_hertz", "Raymaps a second, over the last seconds.",
             fmt::format("{}", status.rate_millihertz() / 1000.0));
  text.gauge("nodal_blend_seconds", "Median time of the last blends.", seconds(status.blend_ns()));
  text.gauge("nodal_resident_bytes", "Memory of nodald.", std::to_string(status.resident_bytes()));
  text.begin("nodal_genlock_state", Type::kGauge, "1 for the state that the genlock is in.");
  text.value("state", status.genlock().state(), "1");
  text.gauge("nodal_genlock_spread_seconds", "Latest minus earliest mid-exposure of the newest full set.",
             seconds(status.genlock().spread_ns()));
  text.counter("nodal_genlock_losses_total", "Times that the genlock was lost since it was started.",
               status.genlock().losses());
  if (status.has_recording()) add_recording(text, status.recording());
  add_heads(text, state.heads);
  return text.take();
}

}  // namespace nodal::host::web
