#include "firmware/operate/settings.h"

#include <fmt/format.h>

#include <limits>
#include <string_view>

#include "firmware/config/exposure_settings.h"
#include "firmware/storage/settings_store.h"
#include "protocol/base/limits.h"
#include "protocol/toml/toml_reader.h"

namespace nodal::firmware {
namespace {

constexpr std::string_view kHead = "# nodal-settings 2, SHA-256 of what follows: ";
constexpr std::size_t kHexBytes = 2 * Sha256{}.size();
constexpr std::int64_t kMax32 = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t kMax64 = std::numeric_limits<std::int64_t>::max();

std::string hex_of(std::string_view text) {
  return to_hex(sha256(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size())));
}

// --- writing ---

void write(std::string& text, std::string_view key, std::int64_t value) {
  text += fmt::format("{} = {}\n", key, value);
}

void write(std::string& text, std::string_view key, std::string_view word) {
  text += std::string(key) + " = \"" + std::string(word) + "\"\n";
}

void write(std::string& text, std::string_view key, bool value) {
  text += std::string(key) + (value ? " = true\n" : " = false\n");
}

void write_head(std::string& text, std::size_t index, const SettingsChange& head) {
  text += "[[heads]]\n";
  write(text, "index", static_cast<std::int64_t>(index));
  if (head.exposure) write(text, "exposure_ns", head.exposure->duration().ns());
  if (head.gain) write(text, "gain_mdb", std::int64_t{head.gain->mdb()});
  if (head.white_balance) {
    write(text, "red_q12", std::int64_t{head.white_balance->red_q12});
    write(text, "blue_q12", std::int64_t{head.white_balance->blue_q12});
  }
  if (head.gamma) write(text, "gamma", std::int64_t{head.gamma->thousandths()});
}

void write_exposure(std::string& text, const ExposureChange& exposure) {
  text += "[exposure]  # stops in 1/1024\n";
  if (exposure.program) write(text, "program", exposure_program_name(*exposure.program));
  if (exposure.anchor) write(text, "anchor", *exposure.anchor ? std::int64_t{**exposure.anchor} : -1);
  if (exposure.target) write(text, "target", std::int64_t{*exposure.target});
  if (exposure.difference) write(text, "difference", std::int64_t{*exposure.difference});
  if (exposure.ramp) write(text, "ramp", std::int64_t{*exposure.ramp});
  if (exposure.longest) write(text, "longest_ns", exposure.longest->duration().ns());
  if (exposure.highest) write(text, "highest_gain_mdb", std::int64_t{exposure.highest->mdb()});
  if (exposure.locked) write(text, "locked", *exposure.locked);
}

void write_genlock(std::string& text, const GenlockStart* start) {
  text += "[genlock]\n";
  write(text, "running", start != nullptr);
  if (!start) return;
  if (start->rate) {
    write(text, "rate_numerator", std::int64_t{start->rate->numerator});
    write(text, "rate_denominator", std::int64_t{start->rate->denominator});
  }
  if (start->pulse_width) write(text, "pulse_width_ns", start->pulse_width->ns());
}

// --- reading: only checks that a value fits its type; check() of the command then checks that it is allowed ---

Duration duration(TomlReader& reader, std::string_view key) {
  return Duration::nanoseconds(reader.integer(key, 0, kMax64, 0));
}

std::int32_t number(TomlReader& reader, std::string_view key) {
  return static_cast<std::int32_t>(reader.integer(key, -kMax32, kMax32, 0));
}

std::uint16_t q12(TomlReader& reader, std::string_view key) {
  return static_cast<std::uint16_t>(reader.integer(key, 0, std::numeric_limits<std::uint16_t>::max(), 0));
}

void read_head(TomlReader reader, std::array<std::optional<SettingsChange>, kMaxHeads>& heads) {
  const auto index = static_cast<std::size_t>(reader.integer("index", 0, kMaxHeads - 1, 0));
  SettingsChange& head = heads[index].emplace();
  if (reader.has("exposure_ns")) head.exposure = Exposure::of(duration(reader, "exposure_ns"));
  if (reader.has("gain_mdb")) head.gain = Gain::millidecibels(number(reader, "gain_mdb"));
  if (reader.has("red_q12") || reader.has("blue_q12")) {
    head.white_balance = WhiteBalance{q12(reader, "red_q12"), q12(reader, "blue_q12")};
  }
  if (reader.has("gamma")) head.gamma = hal::Gamma::thousandths(number(reader, "gamma"));
}

ExposureChange read_exposure(TomlReader reader) {
  ExposureChange exposure;
  if (reader.has("program")) {
    exposure.program = exposure_program_of(reader.text("program", ""));
    if (!exposure.program) reader.refuse("program", "is not an exposure program");
  }
  if (reader.has("anchor")) {
    const std::int64_t anchor = reader.integer("anchor", -1, kMaxHeads - 1, -1);
    exposure.anchor.emplace();
    if (anchor >= 0) *exposure.anchor = static_cast<HeadIndex>(anchor);
  }
  if (reader.has("target")) exposure.target = number(reader, "target");
  if (reader.has("difference")) exposure.difference = number(reader, "difference");
  if (reader.has("ramp")) exposure.ramp = number(reader, "ramp");
  if (reader.has("longest_ns")) exposure.longest = Exposure::of(duration(reader, "longest_ns"));
  if (reader.has("highest_gain_mdb")) exposure.highest = Gain::millidecibels(number(reader, "highest_gain_mdb"));
  if (reader.has("locked")) exposure.locked = reader.boolean("locked", false);
  return exposure;
}

std::variant<GenlockStart, GenlockStop> read_genlock(TomlReader reader) {
  if (!reader.boolean("running", false)) return GenlockStop{};
  GenlockStart start;
  if (reader.has("rate_numerator")) {
    constexpr std::int64_t kMax = std::numeric_limits<std::uint32_t>::max();
    const auto above = static_cast<std::uint32_t>(reader.integer("rate_numerator", 0, kMax, 0));
    const auto below = static_cast<std::uint32_t>(reader.integer("rate_denominator", 0, kMax, 0));
    start.rate = FrameRate::make(above, below);
    if (!start.rate) {
      reader.refuse("rate_numerator", fmt::format("makes a rate of {}/{}, which is not allowed; allowed is {}", above,
                                                  below, kFrameRatesAllowed));
    }
  }
  if (reader.has("pulse_width_ns")) start.pulse_width = duration(reader, "pulse_width_ns");
  return start;
}

}  // namespace

void Settings::remember(const CaptureCommand& change) {
  if (const auto* heads = std::get_if<HeadChange>(&change)) {
    for (std::size_t i = 0; heads->lease == 0 && i < kMaxHeads; ++i) {
      if ((heads->heads & head_bit(i)) == 0) continue;
      if (!heads_[i]) heads_[i].emplace();
      heads_[i]->add(heads->change);
    }
  } else if (const auto* exposure = std::get_if<ExposureChange>(&change)) {
    if (!exposure_) exposure_.emplace();
    exposure_->add(*exposure);
  } else if (const auto* start = std::get_if<GenlockStart>(&change)) {
    genlock_ = *start;
  } else if (std::holds_alternative<GenlockStop>(change)) {
    genlock_ = GenlockStop{};
  }
}

std::vector<CaptureCommand> Settings::commands() const {
  std::vector<CaptureCommand> all;
  // Heads can only be set in the program "manual", so the first change selects it, whatever rig.toml selects.
  if (exposure_) {
    ExposureChange by_hand;
    by_hand.program = ExposureProgram::kManual;
    all.emplace_back(by_hand);
  }
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if (heads_[i]) all.emplace_back(HeadChange{head_bit(i), *heads_[i]});
  }
  if (exposure_) all.emplace_back(*exposure_);
  if (genlock_) std::visit([&](const auto& genlock) { all.emplace_back(genlock); }, *genlock_);
  return all;
}

std::string Settings::encode(const Sha256& rig_toml) const {
  std::string text;
  write(text, "rig_toml", to_hex(rig_toml));
  if (genlock_) write_genlock(text, std::get_if<GenlockStart>(&*genlock_));
  if (exposure_) write_exposure(text, *exposure_);
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if (heads_[i]) write_head(text, i, *heads_[i]);
  }
  std::string file = with_checksum(text);
  NODAL_ASSERT(file.size() <= kMaxSettingsBytes);  // holds because the number of values is fixed
  return file;
}

std::string Settings::with_checksum(std::string_view toml) {
  return std::string(kHead) + hex_of(toml) + "\n" + std::string(toml);
}

Result<Settings> Settings::decode(std::span<const std::uint8_t> file, const Sha256& rig_toml) {
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  const std::size_t head_bytes = kHead.size() + kHexBytes + 1;
  if (!text.starts_with(kHead) || text.size() < head_bytes) {
    return fail(Errc::kBadFormat,
                "the file of stored settings has a wrong header; the rig starts with those of rig.toml");
  }
  const std::string_view toml = text.substr(head_bytes);
  if (text != with_checksum(toml)) {
    return fail(Errc::kChecksum, "the file of stored settings is damaged; the rig starts with those of rig.toml");
  }
  FirstError error("the stored settings are not used, the rig starts with those of rig.toml");
  // With the header line, a TOML comment, so that line numbers are those of the file.
  const toml::parse_result parsed = toml::parse(text);
  if (!parsed) {
    error.set(Errc::kBadFormat, parsed.error().source(), "not TOML: " + std::string(parsed.error().description()));
    return fail(error.get());
  }
  TomlReader reader(parsed.table(), "", {"rig_toml", "genlock", "exposure", "heads"}, error);
  if (!error.any() && reader.text("rig_toml", "") != to_hex(rig_toml)) {
    return fail(Errc::kWrongState,
                "rig.toml was changed after the settings were stored; the rig starts with those of rig.toml");
  }
  Settings settings;
  if (const toml::table* genlock = reader.table("genlock")) {
    settings.genlock_ = read_genlock(
        TomlReader(*genlock, "genlock", {"running", "rate_numerator", "rate_denominator", "pulse_width_ns"}, error));
  }
  if (const toml::table* exposure = reader.table("exposure")) {
    settings.exposure_ = read_exposure(TomlReader(
        *exposure, "exposure",
        {"program", "anchor", "target", "difference", "ramp", "longest_ns", "highest_gain_mdb", "locked"}, error));
  }
  if (const toml::array* heads = reader.array("heads")) {
    for (const toml::node& head : *heads) {
      if (!head.is_table()) {
        reader.refuse("heads", "must be tables, [[heads]]");
        break;
      }
      read_head(TomlReader(*head.as_table(), "heads",
                           {"index", "exposure_ns", "gain_mdb", "red_q12", "blue_q12", "gamma"}, error),
                settings.heads_);
    }
  }
  if (error.any()) return fail(error.get());
  return settings;
}

}  // namespace nodal::firmware
