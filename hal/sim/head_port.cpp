#include "hal/sim/head_port.h"

#include <fmt/format.h>

#include <string>

namespace nodal::hal::sim {

Status SimHead::Port::set_exposure(Exposure exposure) {
  if (head_ == nullptr) return fail(gone());
  if (exposure < limits_.exposure_min || exposure > limits_.exposure_max) {
    return fail(Errc::kBadValue, fmt::format("head '{}': exposure {} us is not between {} and {} us", identity_.path,
                                             exposure.us(), limits_.exposure_min.us(), limits_.exposure_max.us()));
  }
  HeadSettings wanted = head_->settings_.wanted();
  wanted.exposure = exposure;
  head_->change(wanted);
  return {};
}

Status SimHead::Port::set_gain(Gain gain) {
  if (head_ == nullptr) return fail(gone());
  if (gain < limits_.gain_min || gain > limits_.gain_max) {
    return fail(Errc::kBadValue,
                fmt::format("head '{}': gain {:g} dB is not between {:g} and {:g} dB", identity_.path, gain.mdb() / 1e3,
                            limits_.gain_min.mdb() / 1e3, limits_.gain_max.mdb() / 1e3));
  }
  HeadSettings wanted = head_->settings_.wanted();
  wanted.gain = gain;
  head_->change(wanted);
  return {};
}

Status SimHead::Port::set_white_balance(WhiteBalance balance) {
  if (head_ == nullptr) return fail(gone());
  if (!limits_.has_white_balance) {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': has no white balance to set");
  }
  if (balance.red_q12 < kWhiteBalanceMin || balance.blue_q12 < kWhiteBalanceMin) {
    return fail(Errc::kBadValue, fmt::format("head '{}': white balance {}, {} is not between {} and 65535",
                                             identity_.path, balance.red_q12, balance.blue_q12, kWhiteBalanceMin));
  }
  HeadSettings wanted = head_->settings_.wanted();
  wanted.white_balance = balance;
  head_->change(wanted);
  return {};
}

Status SimHead::Port::set_gamma(Gamma gamma) {
  if (head_ == nullptr) return fail(gone());
  if (gamma != Gamma() && limits_.gamma_max == Gamma()) {
    return fail(Errc::kUnsupported, "head '" + identity_.path + "': has no gamma to set");
  }
  if (gamma != Gamma() && (gamma < limits_.gamma_min || gamma > limits_.gamma_max)) {
    return fail(Errc::kBadValue,
                fmt::format("head '{}': gamma {}/1000 is not between {} and {}", identity_.path, gamma.thousandths(),
                            limits_.gamma_min.thousandths(), limits_.gamma_max.thousandths()));
  }
  HeadSettings wanted = head_->settings_.wanted();
  wanted.gamma = gamma;
  head_->change(wanted);
  return {};
}

Result<std::optional<FrameView>> SimHead::Port::take_frame() {
  if (head_ == nullptr) return fail(gone());
  if (!head_->streaming()) {
    return fail(Errc::kWrongState, "head '" + identity_.path + "': take_frame() before start()");
  }
  head_->step(head_->clock_.now());
  if (filled_.empty()) return std::optional<FrameView>{};
  const BufferSlot slot = filled_.front();
  filled_.pop_front();
  Buffer& buffer = buffers_[slot];
  buffer.state = Buffer::State::kLent;
  --head_->counts_.waiting;
  ++head_->counts_.taken;
  FrameView view = head_->picture_.render(buffer.frame, buffer.content);
  view.slot = slot;
  return std::optional<FrameView>{view};
}

}  // namespace nodal::hal::sim
