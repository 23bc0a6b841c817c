// Frame rates from all sources, and all code that counts frames by them: FrameRate itself against independent
// arithmetic, rig.toml and stored settings, the set clock, the drift meter, and the triggers and heads, which must
// catch up after any pause in a bounded number of steps. The input's first byte selects which.
#include <array>
#include <charconv>
#include <string>

#include "exact_rate.h"
#include "firmware/config/config.h"
#include "firmware/operate/settings.h"
#include "firmware/sync/drift.h"
#include "firmware/sync/set_clock.h"
#include "rates_ports.h"

namespace {

using namespace nodal;
using namespace nodal::fuzz;

void check_arithmetic(ByteReader& in) {
  std::uint64_t numerator = telling(in), denominator = telling(in);
  if (denominator == 0) {
    const DrawnRate drawn = drawn_terms(in);
    numerator = drawn.numerator;
    denominator = drawn.denominator;
  }
  const std::optional<FrameRate> rate = FrameRate::make(numerator, denominator);
  NODAL_ASSERT(rate == allowed_rate(numerator, denominator));
  if (!rate) return;
  NODAL_ASSERT(rate->valid());
  const Duration period = rate->period();
  NODAL_ASSERT(period >= Duration::milliseconds(1) && period <= Duration::seconds(1000));
  for (int i = 0; i < 8 && in.left() > 0; ++i) {
    const std::uint64_t frame = telling(in);
    const Duration start = rate->start_of(frame);
    NODAL_ASSERT(begins_at(*rate, frame, start));
    if (frame != ~std::uint64_t{0}) {
      const Duration next = rate->start_of(frame + 1);
      const bool farthest = next.ns() == FrameRate::kFarthestNs;
      NODAL_ASSERT(next >= start && next - start <= period + Duration::nanoseconds(1));
      NODAL_ASSERT(farthest || next - start >= period);
    }
    const auto at = Duration::nanoseconds(static_cast<std::int64_t>(telling(in)));
    NODAL_ASSERT(rate->first_after(at) == frames_begun(*rate, at));
  }
}

/// A rate as text: mostly a fraction, else random characters of one.
std::string rate_text(ByteReader& in) {
  const unsigned kind = in.u8();
  const std::string numerator = std::to_string(telling(in)), denominator = std::to_string(telling(in));
  switch (kind % 4) {
    case 0: return numerator;
    case 1:
    case 2: return numerator + "/" + denominator;
    default: break;
  }
  constexpr std::string_view kLetters = "0123456789/.+- eE";
  std::string letters = text(in);
  for (char& c : letters) c = kLetters[static_cast<unsigned char>(c) % kLetters.size()];
  return letters;
}

/// Digits, or two numbers with a slash: the rate, if it is allowed.
std::optional<FrameRate> rate_said(const std::string& said) {
  const auto number = [](std::string_view digits) -> std::uint64_t {
    if (digits.empty() || digits.find_first_not_of("0123456789") != std::string_view::npos) return 0;
    std::uint64_t value = 0;
    for (const char digit : digits) {
      value = value * 10 + static_cast<std::uint64_t>(digit - '0');
      if (value > UINT32_MAX) return 0;
    }
    return value;
  };
  const std::size_t slash = said.find('/');
  const std::string_view all = said;
  return allowed_rate(number(all.substr(0, slash)), slash == std::string::npos ? 1 : number(all.substr(slash + 1)));
}

void check_rig_toml(ByteReader& in) {
  const std::string said = rate_text(in);
  const std::string toml =
      "[rig]\nname = \"r\"\nrate = \"" + said + "\"\n[[heads]]\nname = \"a\"\nport = \"replay:a.png\"\n";
  const auto config = firmware::parse_rig_config(toml, "rig.toml");
  const std::optional<FrameRate> rate = rate_said(said);
  NODAL_ASSERT(config.has_value() == rate.has_value());
  if (config) NODAL_ASSERT(config->rate == *rate);
  else NODAL_ASSERT(config.error().message.find("rate") != std::string::npos);
}

void check_settings(ByteReader& in) {
  const std::uint32_t numerator = telling32(in), denominator = telling32(in);
  const auto pulse = static_cast<std::int64_t>(telling(in, 63));
  const std::string file = firmware::Settings::with_checksum(
      "rig_toml = \"" + to_hex(Sha256{}) +
      "\"\n[genlock]\nrunning = true\nrate_numerator = " + std::to_string(numerator) +
      "\nrate_denominator = " + std::to_string(denominator) + "\npulse_width_ns = " + std::to_string(pulse) + "\n");
  const auto settings =
      firmware::Settings::decode(std::span(reinterpret_cast<const std::uint8_t*>(file.data()), file.size()), {});
  const std::optional<FrameRate> rate = allowed_rate(numerator, denominator);
  NODAL_ASSERT(settings.has_value() == rate.has_value());
  if (!settings) return;
  const auto commands = settings->commands();
  NODAL_ASSERT(commands.size() == 1);
  const auto& start = std::get<firmware::GenlockStart>(commands.front());
  NODAL_ASSERT(start.rate == rate && start.pulse_width == Duration::nanoseconds(pulse));
}

/// Up to 100 years of the rig's clock.
constexpr std::int64_t kCentury = std::int64_t{100} * 365 * 86'400 * 1'000'000'000;
Instant any_instant(ByteReader& in) {
  return Instant::from_ns(static_cast<std::int64_t>(telling(in) % static_cast<std::uint64_t>(kCentury)));
}

void check_set_clock(ByteReader& in) {
  const std::optional<FrameRate> rate = drawn_rate(in);
  if (!rate) return;
  firmware::SetClock clock(*rate);
  const Duration period = rate->period();
  Instant now = any_instant(in);
  const bool genlocked = in.u8() % 2 == 1;
  clock.restart(*rate, genlocked, now);
  hal::TriggerEdge edge{0, now};
  std::array<std::optional<firmware::SetClock::Slot>, 3> newest;
  for (int i = 0; i < 64 && in.left() > 0; ++i) {
    // At most three periods, or a pause of up to a year.
    const unsigned what = in.u8();
    const Duration pause = what % 16 == 0 ? Duration::nanoseconds(static_cast<std::int64_t>(telling(in, 54)))
                                          : Duration::nanoseconds(period.ns() * (what / 16) / 5);
    now = now + pause;
    if (now.ns() > kCentury) return;
    if (what % 4 == 1) {
      clock.on_edge(edge);
      edge = {edge.number + 1 + in.u8() % 3, now};
      continue;
    }
    // As capture passes them: received now, exposed up to a second and four periods earlier.
    const std::size_t head = what % newest.size();
    const Instant middle = now - Duration::nanoseconds((Duration::seconds(1) + period * 4).ns() * in.u8() / 255);
    const auto exposure = Exposure::microseconds(in.u16());
    const auto delay = Duration::microseconds(in.u16());
    const auto match = clock.match(head, middle, exposure, delay);
    if (!match) continue;
    NODAL_ASSERT(!match->trigger || (genlocked && match->skew >= -period && match->skew <= period));
    newest[head] = std::max(newest[head].value_or(match->slot), match->slot);
    if (what % 4 == 2) clock.follow(match->slot, middle);
    NODAL_ASSERT(clock.period() == period);
  }
}

void check_drift(ByteReader& in) {
  const std::optional<FrameRate> rate = drawn_rate(in);
  if (!rate) return;
  // Drift of up to a tenth, and gaps of up to three periods: more than half a period between two times does not count
  // as drift.
  const std::int64_t ppb = static_cast<std::int64_t>(in.u32() % 200'000'001) - 100'000'000;
  const unsigned gap = 1 + in.u8() % 4;
  const Instant from = any_instant(in);
  std::int64_t number = static_cast<std::int64_t>(telling(in, 40));
  firmware::DriftMeter meter;
  meter.restart(*rate);
  constexpr std::int64_t kBillion = 1'000'000'000;
  constexpr int kMoments = 600;
  for (std::uint64_t n = 0; n < kMoments; ++n) {
    const std::int64_t nominal = rate->start_of(n * gap).ns();
    const auto stretch = static_cast<std::int64_t>(static_cast<__int128>(nominal) * ppb / kBillion);
    meter.add(number + static_cast<std::int64_t>(n * gap), from + Duration::nanoseconds(nominal + stretch));
  }
  const auto measured = meter.ppb();
  NODAL_ASSERT(measured.has_value());
  // The meter's halves are up to half of its 512 periods apart, or of as many times with gaps; it ignores distances
  // above 8 s between them, and each half's mean is rounded to a nanosecond and to a period.
  const double span_ns = static_cast<double>(rate->period().ns()) * 256;
  if (span_ns * static_cast<double>(ppb < 0 ? -ppb : ppb) / kBillion > 7e9) return;
  const double rounding = 4e9 / span_ns * 4 + static_cast<double>(ppb < 0 ? -ppb : ppb) / 64 + 4;
  const double off = static_cast<double>(*measured) - static_cast<double>(ppb);
  NODAL_ASSERT(off <= rounding && off >= -rounding);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(std::span(data, size));
  switch (in.u8() % 16) {
    case 8: check_rig_toml(in); break;
    case 9: check_settings(in); break;
    case 10: check_set_clock(in); break;
    case 11: check_drift(in); break;
    case 12: check_sim_trigger(in); break;
    case 13: check_sim_head(in); break;
    case 14: check_replay_trigger(in); break;
    case 15: check_replay_head(in); break;
    default: check_arithmetic(in); break;
  }
  return 0;
}
