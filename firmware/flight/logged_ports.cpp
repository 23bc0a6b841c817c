#include "firmware/flight/logged_ports.h"

#include <algorithm>
#include <utility>

namespace nodal::firmware {
namespace {

class LoggedHead final : public hal::HeadPort {
 public:
  LoggedHead(HeadIndex index, std::unique_ptr<hal::HeadPort> head, CaptureLog& log)
      : index_(index), head_(std::move(head)), log_(log) {}

  const hal::HeadIdentity& identity() const override { return head_->identity(); }
  const hal::HeadFormat& format() const override { return head_->format(); }
  const hal::HeadLimits& limits() const override { return head_->limits(); }
  Status start(hal::TriggerMode trigger) override {
    return noted(Call::kStart, static_cast<std::int64_t>(trigger), head_->start(trigger));
  }
  void stop() override {
    head_->stop();
    (void)noted(Call::kStop, 0, {});
  }
  Status set_exposure(Exposure exposure) override {
    return noted(Call::kExposure, exposure.duration().ns(), head_->set_exposure(exposure));
  }
  Status set_gain(Gain gain) override { return noted(Call::kGain, gain.mdb(), head_->set_gain(gain)); }
  Status set_white_balance(WhiteBalance balance) override {
    return noted(Call::kWhiteBalance, std::int64_t{balance.red_q12} << 16 | balance.blue_q12,
                 head_->set_white_balance(balance));
  }
  Status set_gamma(hal::Gamma gamma) override {
    return noted(Call::kGamma, gamma.thousandths(), head_->set_gamma(gamma));
  }
  Status nudge(Duration by) override { return noted(Call::kNudge, by.ns(), head_->nudge(by)); }
  Result<std::optional<hal::FrameView>> take_frame() override {
    auto taken = head_->take_frame();
    if (!taken) log_.note(HeadFailed{index_, taken.error()});
    else if (*taken) log_.note(HeadDelivered{index_, **taken});
    return taken;
  }
  void add_wake_ups(hal::WakeUps& to) const override { head_->add_wake_ups(to); }
  /// Not noted: SetReturned and FramesLost say when frames go back.
  void release(hal::BufferSlot slot) override { head_->release(slot); }
  hal::HeadRecoveries recoveries() const override { return head_->recoveries(); }

 private:
  using Call = HeadCalled::Call;
  Status noted(Call call, std::int64_t value, Status status) {
    log_.note(HeadCalled{index_, call, value, status});
    return status;
  }

  const HeadIndex index_;
  const std::unique_ptr<hal::HeadPort> head_;
  CaptureLog& log_;
};

}  // namespace

Result<std::unique_ptr<hal::HeadPort>> LoggedHeads::open(const std::string& path) {
  const auto at = std::ranges::find(paths_, path);
  NODAL_ASSERT(at != paths_.end());
  const auto index = static_cast<HeadIndex>(at - paths_.begin());
  auto opened = heads_.open(path);
  if (!opened) {
    log_.note(HeadOpened{index, fail(opened.error()), {}, {}, {}});
    return opened;
  }
  log_.note(HeadOpened{index, {}, (*opened)->identity(), (*opened)->format(), (*opened)->limits()});
  return std::make_unique<LoggedHead>(index, std::move(*opened), log_);
}

Status LoggedTrigger::start(const hal::TriggerSettings& settings) {
  Status started = trigger_.start(settings);
  log_.note(TriggerStarted{settings, started});
  return started;
}

void LoggedTrigger::stop() {
  trigger_.stop();
  log_.note(TriggerStopped{});
}

Result<std::optional<hal::TriggerEdge>> LoggedTrigger::take_edge() {
  auto edge = trigger_.take_edge();
  if (!edge) log_.note(TriggerFailed{edge.error()});
  else if (*edge) log_.note(PulseSeen{**edge});
  return edge;
}

}  // namespace nodal::firmware
