#include "hal/sim/head_port.h"

#include <string>

namespace nodal::hal::sim {

Status SimHead::Port::set_exposure(Exposure exposure) {
  if (head_ == nullptr) return fail(gone());
  if (exposure < limits_.exposure_min || exposure > limits_.exposure_max) {
    return fail(Errc::kBadValue, "head '" + identity_.path + "': exposure " + std::to_string(exposure.us()) +
                                     " us is not between " + std::to_string(limits_.exposure_min.us()) + " and " +
                                     std::to_string(limits_.exposure_max.us()) + " us");
  }
  HeadSettings wanted = head_->settings_;
  wanted.exposure = exposure;
  head_->change(wanted);
  return {};
}

Status SimHead::Port::set_gain(Gain gain) {
  if (head_ == nullptr) return fail(gone());
  if (gain < limits_.gain_min || gain > limits_.gain_max) {
    return fail(Errc::kBadValue, "head '" + identity_.path + "': gain " + std::to_string(gain.mdb()) +
                                     " mdB is not between " + std::to_string(limits_.gain_min.mdb()) + " and " +
                                     std::to_string(limits_.gain_max.mdb()) + " mdB");
  }
  HeadSettings wanted = head_->settings_;
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
    return fail(Errc::kBadValue, "head '" + identity_.path + "': white balance " + std::to_string(balance.red_q12) +
                                     ", " + std::to_string(balance.blue_q12) + " is not between " +
                                     std::to_string(kWhiteBalanceMin) + " and 65535");
  }
  HeadSettings wanted = head_->settings_;
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
    return fail(Errc::kBadValue, "head '" + identity_.path + "': gamma " + std::to_string(gamma.thousandths()) +
                                     "/1000 is not between " + std::to_string(limits_.gamma_min.thousandths()) +
                                     " and " + std::to_string(limits_.gamma_max.thousandths()));
  }
  HeadSettings wanted = head_->settings_;
  wanted.gamma = gamma;
  head_->change(wanted);
  return {};
}

Result<std::optional<FrameView>> SimHead::Port::take_frame() {
  if (head_ == nullptr) return fail(gone());
  if (!head_->streaming_) {
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
  FrameView view = head_->picture(buffer.frame, buffer.content);
  view.slot = slot;
  return std::optional<FrameView>{view};
}

}  // namespace nodal::hal::sim
