#include "firmware/operate/commands.h"

#include <fmt/format.h>

#include <bit>
#include <type_traits>

#include "protocol/base/limits.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

/// std::visit with a lambda for each alternative.
template <class... Of>
struct Overloaded : Of... {
  using Of::operator()...;
};
template <class... Of>
Overloaded(Of...) -> Overloaded<Of...>;  // clang 14 deduces nothing for aggregates

Status gain_allowed(Gain gain) {
  if (gain.mdb() >= -kMaxGainMdb && gain.mdb() <= kMaxGainMdb) return {};
  return fail(Errc::kBadValue, fmt::format("a gain of {:g} dB is not allowed; allowed is {:g} to {:g} dB",
                                           gain.mdb() / 1e3, -kMaxGainMdb / 1e3, kMaxGainMdb / 1e3));
}

Status stops_allowed(Stops stops, std::int64_t low, const char* what) {
  const std::int64_t thousandths = std::int64_t{stops} * 1000 / kStop;
  const auto at_least = static_cast<Stops>((low * kStop + 500) / 1000);
  if (stops >= at_least && stops <= 8 * kStop) return {};
  return fail(Errc::kBadValue, fmt::format("{} is {} to 8000 thousandths of a stop, not {}", what, low, thousandths));
}

Status check(const HeadChange& change, const RigConfig& config) {
  const HeadMask heads = head_bit(config.heads.size()) - 1;
  if ((change.heads & ~heads) != 0) {
    return fail(no_such_head(static_cast<std::uint64_t>(std::countr_zero(change.heads & ~heads)), config));
  }
  const SettingsChange& wanted = change.change;
  constexpr Duration kLongest = Duration::seconds(3600);  // a head's own limit is far below
  if (wanted.exposure && (wanted.exposure->duration() <= Duration() || wanted.exposure->duration() > kLongest)) {
    return fail(Errc::kBadValue,
                fmt::format("an exposure of {} ns is not allowed; allowed is 1 ns to 1 hour (most heads allow less)",
                            wanted.exposure->duration().ns()));
  }
  if (wanted.gain) {
    NODAL_TRY(gain_allowed(*wanted.gain));
  }
  if (wanted.white_balance && (wanted.white_balance->red_q12 < 256 || wanted.white_balance->blue_q12 < 256)) {
    return fail(Errc::kBadValue, "white balance gains are 256 to 65535, in 1/4096");
  }
  const std::int32_t gamma = wanted.gamma ? wanted.gamma->thousandths() : 0;
  if (gamma != 0 && (gamma < 100 || gamma > 8000)) {
    return fail(Errc::kBadValue, "a gamma is 100 to 8000, in thousandths, or 0 for the head's own curve");
  }
  return {};
}

Status check(const ExposureChange& change, const RigConfig& config) {
  if (change.anchor && *change.anchor && **change.anchor >= config.heads.size()) {
    return fail(Errc::kBadValue, fmt::format("the anchor is head {}, which does not exist", **change.anchor));
  }
  Status good;
  if (change.target) good = stops_allowed(-*change.target, 500, "the target");
  if (good && change.difference) good = stops_allowed(*change.difference, 0, "the difference");
  if (good && change.ramp) good = stops_allowed(*change.ramp, 1, "the ramp");
  if (good && change.highest) good = gain_allowed(*change.highest);
  if (!good) return good;
  if (change.longest &&
      (change.longest->duration() < Duration::microseconds(1) || change.longest->duration() > Duration::seconds(10))) {
    return fail(Errc::kBadValue, "the longest shutter is 1 us to 10 s");
  }
  return {};
}

Status check(const GenlockStart& start, const RigConfig& config) {
  const Duration period = start.rate.value_or(config.rate).period();
  if (!start.pulse_width || (*start.pulse_width > Duration() && *start.pulse_width < period)) return {};
  return fail(Errc::kBadValue,
              fmt::format("a trigger pulse must be shorter than a frame, {} ns, and not 0", period.ns()));
}

Status check(const CalibrationRequest::Install& install) {
  constexpr Duration kLongest = Duration::seconds(24 * 3600);  // a trial takes several sets, also at one set in 1000 s
  if (!install.trial || (*install.trial >= Duration::seconds(1) && *install.trial <= kLongest)) return {};
  return fail(Errc::kBadValue, "a trial lasts 1 s to 24 hours");
}

}  // namespace

const CommandKind& kind_of(const Command& command) {
  const auto row = []<class Type>(const Type&) -> const CommandKind& { return kCommandKind<Type>; };
  return std::visit([&](const auto& of_stage) -> const CommandKind& { return std::visit(row, of_stage); }, command);
}

Status check(const Command& command, const RigConfig& config) {
  if (const auto* change = std::get_if<CaptureCommand>(&command)) {
    return std::visit(Overloaded{[&](const auto& values) { return check(values, config); },
                                 [](const GenlockStop&) { return Status(); }, [](const LeaseEnd&) { return Status(); }},
                      *change);
  }
  if (const auto* take = std::get_if<TakeCommand>(&command)) {
    if (!config.takes) {
      return fail(no_takes());
    }
    const auto* test = std::get_if<TakeRequest::TestDisk>(take);
    if (test && (test->length < DiskTest::kShortest || test->length > DiskTest::kLongest)) {
      return fail(Errc::kBadValue, "a test of the disk lasts 1 s to 60 s");
    }
    const auto* mark = std::get_if<TakeRequest::Mark>(take);
    if (mark && (mark->text.size() > TakeRequest::Mark::kMaxBytes || !is_printable(mark->text))) {
      return fail(Errc::kBadValue,
                  fmt::format("a mark's text has at most {} printable bytes", TakeRequest::Mark::kMaxBytes));
    }
    return {};
  }
  const auto* install = std::get_if<CalibrationRequest::Install>(&std::get<CalibrationCommand>(command));
  return install ? check(*install) : Status();
}

Error no_takes() {
  return {
      Errc::kUnsupported,
      "this rig has no folder for takes; add the two lines [takes] and folder = \"takes\" to its rig.toml, and start "
      "nodald again"};
}

Error no_such_head(std::uint64_t head, const RigConfig& config) {
  return {Errc::kBadValue, fmt::format("there is no head {}; the rig has 0 to {}", head, config.heads.size() - 1)};
}

}  // namespace nodal::firmware
