#include "firmware/capture/capture_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

/// Interval of the retries while a head is disconnected: short enough to find it within a few frames, and a try is
/// cheap.
constexpr Duration kRetry = Duration::milliseconds(200);

std::string microseconds(Exposure exposure) { return fmt::format("{} us", exposure.us()); }
std::string thousandths(hal::Gamma gamma) { return fmt::format("{}/1000", gamma.thousandths()); }
std::string decibels(Gain gain) { return fmt::format("{:g} dB", gain.mdb() / 1e3); }

std::optional<LossReason> bad_verdict(hal::FrameVerdict verdict) {
  switch (verdict) {
    case hal::FrameVerdict::kGood: return std::nullopt;
    case hal::FrameVerdict::kCorrupt: return LossReason::kCorrupt;
    case hal::FrameVerdict::kTorn: return LossReason::kTorn;
    case hal::FrameVerdict::kNoSignal: return LossReason::kNoSignal;
  }
  return LossReason::kCorrupt;
}

/// Compares a frame's fields with the head's stated format: both fields, and the stated one first.
std::optional<LossReason> bad_fields(Fields came, Fields promised) {
  if (came == promised) return std::nullopt;
  const auto whole = [](Fields f) { return f == Fields::kTopFirst || f == Fields::kBottomFirst; };
  return whole(came) && whole(promised) ? LossReason::kFieldOrder : LossReason::kFieldParity;
}

/// The error of a value outside the head's limits. Limits of one value mean that the setting cannot be changed.
Status refuse(const std::string& setting, const std::string& wanted, const std::string& lowest,
              const std::string& highest) {
  if (lowest == highest) return fail(Errc::kBadValue, setting + " cannot be changed; it is " + lowest);
  return fail(Errc::kBadValue, setting + " cannot be " + wanted + "; allowed are " + lowest + " to " + highest);
}

/// Whether the requested settings are in effect, within 1/16 of the value, 400 mdB of gain (1/15 stop) or 0.05 of
/// gamma: heads round requests to steps of their own, which are smaller than that.
bool matches(const SettingsChange& wanted, const hal::HeadSettings& in_effect) {
  if (wanted.exposure) {
    const std::int64_t apart = in_effect.exposure.us() - wanted.exposure->us();
    if (std::abs(apart) > std::max<std::int64_t>(wanted.exposure->us() / 16, 1)) return false;
  }
  if (wanted.gain && std::abs(wanted.gain->mdb() - in_effect.gain.mdb()) > 400) return false;
  if (wanted.gamma && std::abs(wanted.gamma->thousandths() - in_effect.gamma.thousandths()) > 50) return false;
  if (!wanted.white_balance) return true;
  const auto far = [](std::uint16_t a, std::uint16_t b) { return std::abs(int{a} - int{b}) > b / 16; };
  return !far(in_effect.white_balance.red_q12, wanted.white_balance->red_q12) &&
         !far(in_effect.white_balance.blue_q12, wanted.white_balance->blue_q12);
}

}  // namespace

void SettingsChange::add(const SettingsChange& newer) {
  if (newer.exposure) exposure = newer.exposure;
  if (newer.gain) gain = newer.gain;
  if (newer.white_balance) white_balance = newer.white_balance;
  if (newer.gamma) gamma = newer.gamma;
}

void SettingsChange::remove(const SettingsChange& other) {
  if (other.exposure) exposure.reset();
  if (other.gain) gain.reset();
  if (other.white_balance) white_balance.reset();
  if (other.gamma) gamma.reset();
}

std::uint64_t FrameCounts::lost() const { return std::accumulate(losses.begin(), losses.end(), std::uint64_t{0}); }

void FrameCounts::add(const FrameCounts& other) {
  frames += other.frames;
  in_sets += other.in_sets;
  held += other.held;
  for (std::size_t i = 0; i < kLossReasons; ++i) losses[i] += other.losses[i];
}

CaptureHead::CaptureHead(const HeadConfig& config, std::string path, hal::HeadEnumerator& enumerator)
    : name_(config.name),
      path_(std::move(path)),
      wired_(config.wired),
      enumerator_(enumerator),
      wanted_{config.exposure, config.gain, config.white_balance, config.gamma} {
  report_.path = path_;
  report_.problem = "not found yet at " + path_;
}

CaptureHead::~CaptureHead() {
  if (port_) port_->stop();
}

bool CaptureHead::step(Instant now, hal::TriggerMode mode) {
  if (gone_ && lent_ == 0) {
    port_.reset();
    gone_ = false;
    next_try_ = now + kRetry;
  }
  if (gone_) return false;
  if (!port_) {
    if (next_try_ && now < *next_try_) return false;
    next_try_ = now + kRetry;
    open(now);
    return port_ != nullptr;
  }
  if (wired_) mode = hal::TriggerMode::kWired;
  restarting_ = started_ && mode_ != mode;
  if (started_ && !restarting_) return false;
  if (started_) {
    if (lent_ > 0) return false;  // the blend still reads; it releases the frames within the time of one raymap
    port_->stop();
    started_ = restarting_ = false;
    report_.started_by.reset();
  }
  if (next_try_ && now < *next_try_) return false;
  start(mode, now);
  return true;
}

void CaptureHead::add_wake_ups(hal::WakeUps& to) const {
  if (streaming()) port_->add_wake_ups(to);
  else if (!gone_ && !restarting_ && next_try_) to.at(*next_try_);
}

void CaptureHead::open(Instant) {
  auto opened = enumerator_.open(path_);
  if (!opened) {
    report_.problem = opened.error().message;
    return;
  }
  port_ = std::move(*opened);
  recoveries_before_ = report_.recoveries;
  started_ = false;
  next_try_.reset();
  const hal::HeadIdentity& identity = port_->identity();
  report_.model = identity.model;
  report_.serial = identity.serial;
  report_.format = port_->format();
  report_.limits = port_->limits();
  report_.present = true;
  report_.problem.clear();
  ++report_.opened;
  if (const Status requested = request(wanted()); !requested) report_.problem = requested.error().message;
}

void CaptureHead::start(hal::TriggerMode mode, Instant now) {
  if (gone_ || !port_) return;
  if (const Status begun = port_->start(mode); !begun) {
    if (begun.error().code == Errc::kDeviceGone) return vanish(begun.error());
    report_.problem = begun.error().message;
    next_try_ = now + kRetry;
    return;
  }
  next_try_.reset();
  ++starts_;
  started_ = true;
  mode_ = mode;
  report_.started_by = mode;
  missed_in_row_ = 0;
  back_in_sets();
}

void CaptureHead::vanish(const Error& why) {
  gone_ = true;
  started_ = restarting_ = false;
  back_in_sets();
  report_.present = false;
  report_.started_by.reset();
  report_.problem = why.message;
}

std::optional<hal::FrameView> CaptureHead::take_frame() {
  if (!streaming()) return std::nullopt;
  auto taken = port_->take_frame();
  const hal::HeadRecoveries recoveries = port_->recoveries();
  report_.recoveries = {recoveries_before_.restarts + recoveries.restarts,
                        recoveries_before_.refused_buffers + recoveries.refused_buffers};
  if (!taken) {
    vanish(taken.error());
    return std::nullopt;
  }
  if (!*taken) return std::nullopt;
  const hal::FrameView& frame = **taken;
  ++report_.counts.frames;
  ++lent_;
  report_.in_effect = frame.in_effect;
  watch_settings(frame.in_effect);
  missed_in_row_ = 0;
  const hal::HeadFormat& format = port_->format();
  std::optional<LossReason> reason = bad_verdict(frame.verdict);
  if (!reason && (frame.image.format != format.pixels || frame.image.width != format.width ||
                  frame.image.height != format.height || !frame.image.planes[0].data)) {
    reason = LossReason::kWrongFormat;
  }
  if (!reason) reason = bad_fields(frame.fields, format.fields);
  if (!reason) return frame;
  lose(frame, *reason);
  return std::nullopt;
}

/// Reports a head that does not apply requested settings: they differ from the settings in its frames for longer than
/// the stated latency and kFramesOfGrace.
void CaptureHead::watch_settings(const hal::HeadSettings& in_effect) {
  const SettingsChange wanted = this->wanted();
  if (matches(wanted, in_effect)) {
    report_.ignores.clear();
  } else if (++frames_since_request_ > report_.limits->control_latency_frames + kFramesOfGrace &&
             report_.ignores.empty()) {
    report_.ignores =
        "does not apply its settings: in effect " + microseconds(in_effect.exposure) + ", " + decibels(in_effect.gain);
    if (wanted.exposure) report_.ignores += "; requested " + microseconds(*wanted.exposure);
    if (wanted.gain) report_.ignores += "; requested " + decibels(*wanted.gain);
  }
}

void CaptureHead::lose(const hal::FrameView& frame, LossReason reason) {
  ++report_.counts.losses[static_cast<std::size_t>(reason)];
  report_.newest_loss = reason;
  NODAL_ASSERT(lent_ > 0);
  --lent_;
  port_->release(frame.slot);
}

void CaptureHead::hold(const hal::FrameView&) { ++report_.counts.held; }

void CaptureHead::put_in_set(Duration skew) {
  NODAL_ASSERT(report_.counts.held > 0);
  --report_.counts.held;
  ++report_.counts.in_sets;
  ++in_flight_;
  report_.skew = skew;
  back_in_sets();
}

void CaptureHead::back_in_sets() {
  sets_without_it_ = 0;
  report_.in_no_set = false;
  report_.newest_loss.reset();
}

void CaptureHead::release(hal::BufferSlot slot) {
  NODAL_ASSERT(in_flight_ > 0 && lent_ > 0 && port_);
  --in_flight_;
  --lent_;
  port_->release(slot);
}

void CaptureHead::missed_set(Duration period) {
  ++report_.missing_sets;
  if (missed_in_row_ < kMissedUntilSilent) ++missed_in_row_;
  if (streaming() && period * ++sets_without_it_ >= kInNoSet.at(period)) report_.in_no_set = true;
}

Status CaptureHead::check(const SettingsChange& change) const {
  if (!report_.limits || !report_.present) return {};
  const hal::HeadLimits& limits = *report_.limits;
  const std::string head = "head '" + name_ + "': ";
  if (change.exposure && (*change.exposure < limits.exposure_min || *change.exposure > limits.exposure_max)) {
    return refuse(head + "its exposure", microseconds(*change.exposure), microseconds(limits.exposure_min),
                  microseconds(limits.exposure_max));
  }
  if (change.gain && (*change.gain < limits.gain_min || *change.gain > limits.gain_max)) {
    return refuse(head + "its gain", decibels(*change.gain), decibels(limits.gain_min), decibels(limits.gain_max));
  }
  if (change.white_balance && !limits.has_white_balance) {
    return fail(Errc::kUnsupported, head + "has no white balance to set");
  }
  if (change.gamma && *change.gamma != hal::Gamma()) {
    if (limits.gamma_max == hal::Gamma()) return fail(Errc::kUnsupported, head + "has no gamma to set");
    if (*change.gamma < limits.gamma_min || *change.gamma > limits.gamma_max) {
      return refuse(head + "its gamma", thousandths(*change.gamma), thousandths(limits.gamma_min),
                    thousandths(limits.gamma_max));
    }
  }
  return {};
}

Status CaptureHead::request(const SettingsChange& change) {
  NODAL_TRY(check(change));
  Status requested;
  if (change.exposure) requested = port_->set_exposure(*change.exposure);
  if (requested && change.gain) requested = port_->set_gain(*change.gain);
  if (requested && change.white_balance) requested = port_->set_white_balance(*change.white_balance);
  if (requested && change.gamma) requested = port_->set_gamma(*change.gamma);
  frames_since_request_ = 0;
  if (requested) return {};
  if (requested.error().code == Errc::kDeviceGone) {
    vanish(requested.error());
    return {};  // open() requests the settings again when it returns
  }
  return fail(requested.error().in("head '" + name_ + "'"));
}

Status CaptureHead::change(const SettingsChange& change, std::uint64_t lease) {
  const SettingsChange before = this->before(change);
  if (port_ && !gone_) {
    NODAL_TRY(request(change));
  }
  if (lease != 0) {
    if (!temporary_) temporary_ = Temporary{lease, {}, {}};
    SettingsChange first = before;
    first.remove(temporary_->change);  // it was temporary already
    temporary_->before.add(first);
    temporary_->change.add(change);
    return {};
  }
  wanted_.add(change);
  if (!temporary_) return {};
  temporary_->change.remove(change);
  temporary_->before.remove(change);
  if (temporary_->change.empty()) temporary_.reset();
  return {};
}

/// The present values of the fields that `change` has: the requested ones, else those of the newest frame, if there is
/// one.
SettingsChange CaptureHead::before(const SettingsChange& change) const {
  SettingsChange all;
  if (report_.counts.frames > 0) {
    const hal::HeadSettings& now = report_.in_effect;
    all = {now.exposure, now.gain, now.white_balance, now.gamma};
  }
  all.add(wanted_);
  SettingsChange others = all;
  others.remove(change);
  all.remove(others);
  return all;
}

SettingsChange CaptureHead::wanted() const {
  SettingsChange all = wanted_;
  if (temporary_) all.add(temporary_->change);
  return all;
}

Status CaptureHead::check_lease(std::uint64_t lease) const {
  if (!temporary_ || temporary_->lease == lease) return {};
  return fail(Errc::kBusy, "head '" + name_ + "' has temporary settings of another host; try again later");
}

Status CaptureHead::end_lease(std::uint64_t lease) {
  if (!temporary_ || temporary_->lease != lease) return {};
  const SettingsChange before = std::exchange(temporary_, std::nullopt)->before;
  wanted_.add(before);  // so that a head that is disconnected now gets it when it returns
  return port_ && !gone_ ? request(before) : Status();
}

void CaptureHead::nudge(Duration by) {
  if (!streaming()) return;
  const Status requested = port_->nudge(by);
  if (requested) return;
  if (requested.error().code == Errc::kDeviceGone) return vanish(requested.error());
  report_.problem = requested.error().message;
}

Exposure CaptureHead::pending_exposure() const {
  const std::optional<Exposure> exposure = wanted().exposure;
  const bool pending = exposure && !matches({exposure, {}, {}, {}}, report_.in_effect) &&
                       frames_since_request_ <= report_.limits->control_latency_frames + kFramesOfGrace;
  return pending ? *exposure : report_.in_effect.exposure;
}

bool CaptureHead::conserved() const { return report_.counts.conserved() && lent_ == report_.counts.held + in_flight_; }

void CaptureHead::close() {
  NODAL_ASSERT(lent_ == 0);
  if (temporary_) (void)end_lease(temporary_->lease);  // a camera may keep its settings
  if (port_) port_->stop();
  port_.reset();
  started_ = gone_ = report_.present = false;
}

}  // namespace nodal::firmware
