#include "firmware/daemon/traced_heads.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "firmware/daemon/log.h"

namespace nodal::daemon {
namespace {

constexpr Duration kMissingEvery = Duration::seconds(1);

void write(LogLevel level, const std::string& line) { log_line(LogCategory::kCapture, level, line); }

const char* mode_name(hal::TriggerMode mode) {
  switch (mode) {
    case hal::TriggerMode::kFreeRun: return "in free run";
    case hal::TriggerMode::kExternal: return "by pulses on its trigger input";
    case hal::TriggerMode::kWired: return "by pulses on a wire that its driver does not know";
  }
  return "?";
}

const char* verdict_name(hal::FrameVerdict verdict) {
  switch (verdict) {
    case hal::FrameVerdict::kGood: return "good";
    case hal::FrameVerdict::kCorrupt: return "corrupt";
    case hal::FrameVerdict::kTorn: return "shorter than a frame";
    case hal::FrameVerdict::kNoSignal: return "the input has no picture";
  }
  return "?";
}

std::string result_text(const Status& status) { return status ? std::string() : " -> " + status.error().text(); }

class TracedHead final : public hal::HeadPort {
 public:
  TracedHead(std::unique_ptr<hal::HeadPort> head, std::string path, hal::ClockPort& clock)
      : head_(std::move(head)), path_(std::move(path)), clock_(clock) {}
  ~TracedHead() override { write(LogLevel::kDebug, path_ + ": closed"); }

  const hal::HeadIdentity& identity() const override { return head_->identity(); }
  const hal::HeadFormat& format() const override { return head_->format(); }
  const hal::HeadLimits& limits() const override { return head_->limits(); }

  Status start(hal::TriggerMode trigger) override {
    Status status = head_->start(trigger);
    write(LogLevel::kDebug, fmt::format("{}: start, exposed {}{}", path_, mode_name(trigger), result_text(status)));
    newest_ = missing_ = clock_.now();
    sequence_.reset();
    return status;
  }
  void stop() override {
    head_->stop();
    write(LogLevel::kDebug, path_ + ": stop");
  }
  Status set_exposure(Exposure exposure) override {
    return made(fmt::format("exposure {} us", exposure.us()), head_->set_exposure(exposure));
  }
  Status set_gain(Gain gain) override { return made(fmt::format("gain {} mdB", gain.mdb()), head_->set_gain(gain)); }
  Status set_white_balance(WhiteBalance balance) override {
    return made(fmt::format("white balance red {}/4096, blue {}/4096", balance.red_q12, balance.blue_q12),
                head_->set_white_balance(balance));
  }
  Status set_gamma(hal::Gamma gamma) override {
    return made(fmt::format("gamma {}/1000", gamma.thousandths()), head_->set_gamma(gamma));
  }
  Status nudge(Duration by) override { return made(fmt::format("shift by {} us", by.us()), head_->nudge(by)); }

  Result<std::optional<hal::FrameView>> take_frame() override {
    Result<std::optional<hal::FrameView>> frame = head_->take_frame();
    if (!frame) {
      write(LogLevel::kDebug, path_ + ": take a frame -> " + frame.error().text());
    } else if (*frame) {
      note(**frame);
    } else if (const Instant now = clock_.now(); now - missing_ >= kMissingEvery) {
      missing_ = now;
      write(LogLevel::kDebug, fmt::format("{}: no frame for {} ms", path_, (now - newest_).ms()));
    }
    return frame;
  }
  void add_wake_ups(hal::WakeUps& to) const override { head_->add_wake_ups(to); }
  void release(hal::BufferSlot slot) override { head_->release(slot); }
  hal::HeadRecoveries recoveries() const override { return head_->recoveries(); }

 private:
  Status made(const std::string& setting, Status status) {
    write(LogLevel::kDebug, path_ + ": " + setting + result_text(status));
    return status;
  }
  void note(const hal::FrameView& frame) {
    newest_ = missing_ = clock_.now();
    if (sequence_ && frame.sequence != *sequence_ + 1) {
      write(LogLevel::kDebug,
            fmt::format("{}: the device's count goes from {} to {}", path_, *sequence_, frame.sequence));
    }
    sequence_ = frame.sequence;
    const bool good = frame.verdict == hal::FrameVerdict::kGood;
    if (good && !logs(LogCategory::kCapture, LogLevel::kTrace)) return;
    write(good ? LogLevel::kTrace : LogLevel::kDebug,
          fmt::format("{}: frame {}, buffer {}, {}, exposed {} us before it was there", path_, frame.sequence,
                      frame.slot, verdict_name(frame.verdict), (frame.received - frame.mid_exposure).us()));
  }

  const std::unique_ptr<hal::HeadPort> head_;
  const std::string path_;
  hal::ClockPort& clock_;
  Instant newest_;   ///< when the newest frame was taken, or the head started
  Instant missing_;  ///< when a missing frame was written last, or as newest_
  std::optional<std::uint32_t> sequence_;
};

}  // namespace

Result<std::unique_ptr<hal::HeadPort>> TracedHeads::open(const std::string& path) {
  Result<std::unique_ptr<hal::HeadPort>> head = heads_.open(path);
  std::string result = head ? fmt::format("open: {}x{} {}", (*head)->format().width, (*head)->format().height,
                                          pixel_format_name((*head)->format().pixels))
                            : "open -> " + head.error().text();
  if (std::string& before = results_[path]; head || before != result) {
    write(LogLevel::kDebug, path + ": " + result);
    before = std::move(result);
  }
  if (!head) return head;
  return std::unique_ptr<hal::HeadPort>(std::make_unique<TracedHead>(std::move(*head), path, clock_));
}

}  // namespace nodal::daemon
