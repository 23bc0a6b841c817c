#include "firmware/config/gpio_entry.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>

namespace nodal::firmware {
namespace {

constexpr std::string_view kGpio = "gpio:";
constexpr std::size_t kLongestChip = 31;  ///< bytes of a label; the kernel's limit
constexpr Duration kGap = Duration::microseconds(100);

bool is_chip(std::string_view text) {
  return !text.empty() && text.size() <= kLongestChip &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~' && c != '/'; });
}

/// Removes the text up to the next comma, and that comma, from the front.
std::string_view take_word(std::string_view& text) {
  const std::size_t comma = text.find(',');
  const std::string_view word = text.substr(0, comma);
  text.remove_prefix(comma == std::string_view::npos ? text.size() : comma + 1);
  return word;
}

std::optional<GpioLine> parse(std::string_view text, const LineOptions& allowed) {
  if (!text.starts_with(kGpio)) return std::nullopt;
  text.remove_prefix(kGpio.size());
  const std::size_t colon = text.rfind(':');  // labels may have colons: "INT34BB:00"
  if (colon == std::string_view::npos || text.ends_with(',')) return std::nullopt;
  GpioLine line;
  line.chip = text.substr(0, colon);
  text.remove_prefix(colon + 1);
  const std::string_view number = take_word(text);
  constexpr std::uint32_t kMaxLines = 65'536;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), line.offset);
  if (!is_chip(line.chip) || error != std::errc{} || end != number.data() + number.size()) return std::nullopt;
  if (line.offset >= kMaxLines) return std::nullopt;
  while (!text.empty()) {
    const std::string_view word = take_word(text);
    if (word == "low" && allowed.low && !line.low) line.low = true;
    else if (word == "pull-up" && allowed.pull && line.pull == GpioPull::kNone) line.pull = GpioPull::kUp;
    else if (word == "pull-down" && allowed.pull && line.pull == GpioPull::kNone) line.pull = GpioPull::kDown;
    else return std::nullopt;
  }
  return line;
}

std::string form(const LineOptions& allowed) {
  return std::string(allowed.otherwise) + "gpio:CHIP:LINE" + (allowed.low ? "[,low]" : "") +
         (allowed.pull ? "[,pull-up or ,pull-down]" : "") +
         " such as \"gpio:gpiochip0:17\": CHIP is a name or label as gpiodetect prints it (at most 31 characters, no "
         "/), LINE a number from 0 to 65535";
}

struct NamedLine {
  std::string where;  ///< such as "panel.button"
  GpioLine line;
};

std::vector<NamedLine> all_lines(const RigConfig& config) {
  std::vector<NamedLine> all;
  const auto add = [&](const std::string& where, const std::optional<GpioLine>& line) {
    if (line) all.push_back({where, *line});
  };
  add("trigger.port", config.trigger.port);
  add("trigger.readback", config.trigger.readback);
  for (const HeadConfig& head : config.heads) add("trigger of head '" + head.name + "'", head.trigger);
  add("panel.button", config.panel.button_line);
  add("panel.status", config.panel.status_line);
  add("panel.tally", config.panel.tally_line);
  return all;
}

/// Several heads may name one line: it is wired to all of them.
bool is_of_heads(const NamedLine& line) { return line.where.starts_with("trigger of head"); }

const GpioLine* line_of(const RigConfig& config, const HeadConfig& head) {
  if (head.trigger) return &*head.trigger;
  return config.trigger.port ? &*config.trigger.port : nullptr;
}

void check_delays(TomlReader& file, const RigConfig& config) {
  for (const HeadConfig& head : config.heads) {
    const GpioLine* const line = line_of(config, head);
    if (line == nullptr) {
      return file.refuse("heads", "name trigger lines, but head '" + head.name +
                                      "' has none; add trigger to its entry, or port to [trigger]");
    }
    if (head.wired) continue;  // its delay is its own; the pulse is not delayed
    const HeadConfig& first = *std::find_if(config.heads.begin(), config.heads.end(), [&](const HeadConfig& other) {
      return !other.wired && line_of(config, other) != nullptr && *line_of(config, other) == *line;
    });
    if (first.trigger_delay == head.trigger_delay) continue;
    return file.refuse(
        "heads", fmt::format("'{}' and '{}' share the trigger line {}, but their trigger_delay_us are {} and {}; add "
                             "trigger with a line of its own to the entry of one of them",
                             first.name, head.name, line->text(), first.trigger_delay.us(), head.trigger_delay.us()));
  }
}

void check_trigger(TomlReader& file, const RigConfig& config) {
  const TriggerConfig& trigger = config.trigger;
  const bool heads_have = std::any_of(config.heads.begin(), config.heads.end(),
                                      [](const HeadConfig& head) { return head.trigger.has_value(); });
  if (!trigger.port && !trigger.readback && !heads_have) return;
  const auto refuse = [&](const std::string& sentence) { file.refuse("trigger", sentence); };
  if (trigger.source == SyncSource::kNone) {
    return refuse("has source = \"none\", so no line is used; remove port, readback and the trigger of heads");
  }
  if (trigger.source == SyncSource::kExternal && (heads_have || trigger.readback)) {
    return refuse(
        "has source = \"external\": port is the input that the pulses come in by, and the other device drives the "
        "heads; remove readback and the trigger of heads");
  }
  if (trigger.source == SyncSource::kOwn && trigger.port && trigger.port->pull != GpioPull::kNone) {
    return refuse("has a port with a pull, which is for inputs only; remove it, or set source = \"external\"");
  }
  if (trigger.readback && !trigger.port) return refuse("has a readback without a port, whose pulses it would measure");
  if (trigger.pulse_width > config.rate.period() - kGap) {
    return refuse(
        fmt::format("has a pulse_width_us that leaves less than {} us between two pulses on a gpio: line", kGap.us()));
  }
  if (trigger.source == SyncSource::kOwn) check_delays(file, config);
}

}  // namespace

std::string GpioLine::text() const { return fmt::format("{}{}:{}", kGpio, chip, offset); }

std::optional<GpioLine> read_line(TomlReader& reader, std::string_view key, const LineOptions& allowed) {
  if (!reader.has(key)) return std::nullopt;
  auto line = parse(reader.text(key, ""), allowed);
  if (!line) reader.refuse(key, "must be " + form(allowed));
  return line;
}

void check_lines(TomlReader& file, const RigConfig& config) {
  const std::vector<NamedLine> lines = all_lines(config);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const bool same = lines[i].line.chip == lines[j].line.chip && lines[i].line.offset == lines[j].line.offset;
      if (!same || (is_of_heads(lines[i]) && is_of_heads(lines[j]))) continue;
      return file.refuse(
          is_of_heads(lines[i]) ? "heads" : lines[i].where.substr(0, lines[i].where.find('.')),
          "uses line " + lines[i].line.text() + " twice: for " + lines[j].where + " and for " + lines[i].where);
    }
  }
  const bool fast = config.sim && config.sim->clock == SimConfig::Clock::kFast;
  if (fast && !lines.empty()) {
    return file.refuse("sim", "has clock = \"fast\", but " + lines.front().where + " is a gpio: line, in real time");
  }
  check_trigger(file, config);
}

}  // namespace nodal::firmware
