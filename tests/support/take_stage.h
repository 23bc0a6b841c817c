// The recorder and the disk's stage on any disk, in virtual time: sets come at their times, also while the disk is
// busy.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/record/recorder.h"
#include "firmware/record/take_keeper.h"
#include "hal/disk.h"
#include "hal/sim/clock.h"

namespace nodal::firmware {

/// The pictures are grey, and begin with the number of their set.
class TakeStage {
 public:
  static constexpr int kStageHeads = 2;
  struct Options {
    TakesConfig takes{.folder = "takes", .buffer_mb = 16, .raymap = false};
    FrameRate rate{5, 1};                   ///< rate of the sets
    std::optional<FrameRate> configured{};  ///< rig.toml's; empty: the same
    int width = 32;                         ///< width of the pictures, px
    int height = 16;
    std::array<TakeMode, kStageHeads> modes{};  ///< mode of each head
    hal::ConfinedPort* confined = nullptr;      ///< where takes are recovered
    FlightLog* flight = nullptr;
    std::function<void()> stepped{};  ///< called after each step of the disk's stage
  };

  /// 153600 bytes a set, 30 a second: 4.6 MB/s.
  static Options large_pictures() {
    Options options;
    options.rate = {30, 1};
    options.width = 320;
    options.height = 240;
    return options;
  }

  TakeStage(hal::DiskPort& disk, hal::sim::SimClock& clock, const Options& options)
      : options_(options),
        clock_(clock),
        config_(config(options)),
        recorder_(config_, sets_in_, encoder_),
        keeper_(
            config_, disk, recorder_, "a test", [this] { return utc_ ? *utc_ + clock_.now().ns() : 0; }, options.flight,
            nullptr, options.confined),
        next_set_at_(clock.now()),
        pixels_(static_cast<std::size_t>(options.width * options.height), 90) {
    settle(clock_.now());
  }

  /// Not inlined: GCC 12 then warns that the variant's other alternatives are uninitialized.
  [[gnu::noinline]] void request(const TakeCommand& what, const Presence& host = {}) {
    const bool pushed = keeper_.requests().push({++ticket_, what, host});
    NODAL_ASSERT(pushed);
  }
  /// What the stage answers next. Sets go on coming.
  TakeAnswer next_answer() {
    for (int k = 0; k < 10'000; ++k) {
      if (auto answer = keeper_.answers().pop()) return std::move(*answer);
      run(std::min(rate_.period(), Duration::milliseconds(200)));
    }
    return {0, fail(Errc::kTimeout, "no answer")};
  }
  TakeAnswer ask(const TakeCommand& what) {
    request(what);
    return next_answer();
  }
  TakeAnswer start(bool still = false) { return ask(start_request(still)); }
  TakeCommand start_request(bool still = false) const {
    TakeRequest::Start start;
    start.still = still;
    start.rate = rate_;
    for (std::size_t k = 0; k < kStageHeads; ++k)
      start.heads.push_back(HeadShape{PixelFormat::kGrey8, options_.width, options_.height});
    return start;
  }
  /// Drops answers to hosts that are gone.
  void drop_answers() {
    while (keeper_.answers().pop()) {}
  }
  std::vector<TakeEntry> list() {
    const TakeAnswer answer = ask(TakeRequest::List{});
    if (!answer.result) return {};
    return std::get<TakeAnswer::Listed>(*answer.result).takes;
  }

  void run(Duration length) {
    const Instant end = clock_.now() + length;
    while (clock_.now() < end) {
      clock_.advance_to(std::max(clock_.now(), std::min(next_set_at_, end)));
      offer_due();
      settle(end);
    }
  }
  /// For so long no set comes, as when nodald is not scheduled.
  void pause(Duration length) { next_set_at_ = next_set_at_ + length; }
  /// From the next set on.
  void set_rate(FrameRate rate) { rate_ = rate; }
  FrameRate rate() const { return rate_; }
  /// The board's clock is set: nanoseconds since 1970 at 0 of the rig's clock; empty: it is not known any more.
  void set_utc(std::optional<std::int64_t> at_zero) { utc_ = at_zero; }
  /// Times of the sets that were offered, by their numbers.
  const std::vector<Instant>& times() const { return times_; }
  /// Ends as nodald does.
  void close() { keeper_.close(clock_.now()); }
  const TakeReport& report() { return keeper_.snapshot().read(); }
  /// What the report said, in order.
  const std::vector<std::string>& problems() const { return problems_; }
  std::uint64_t offered() const { return next_; }
  Recorder& recorder() { return recorder_; }
  TakesInUse& in_use() { return keeper_.in_use(); }

  static constexpr std::int64_t kUtcNs = 1'700'000'000'000'000'000;

 private:
  static RigConfig config(const Options& options) {
    RigConfig config;
    config.name = "test";
    config.rate = options.configured.value_or(options.rate);
    config.heads.resize(kStageHeads);
    for (std::size_t k = 0; k < kStageHeads; ++k) {
      config.heads[k].name = "head" + std::to_string(k);
      config.heads[k].take_mode = options.modes[k];
    }
    config.raymap.width = 64;
    config.raymap.height = 32;
    config.takes = options.takes;
    return config;
  }
  void offer_due() {
    for (; next_set_at_ <= clock_.now(); next_set_at_ = next_set_at_ + rate_.period()) {
      SetLoan loan = pool_.take();
      NODAL_ASSERT(loan);
      FrameSet& set = loan.edit();
      set = {};
      set.number = next_++;
      set.mid_exposure = next_set_at_;
      set.rate = rate_;
      set.period = rate_.period();
      times_.push_back(next_set_at_);
      set.mask = (1U << kStageHeads) - 1;
      for (std::size_t k = 0; k < 8; ++k) pixels_[k] = static_cast<std::uint8_t>(set.number >> (8 * k));
      for (std::size_t head = 0; head < kStageHeads; ++head) {
        set.frames[head].image =
            packed_image(PixelFormat::kGrey8, options_.width, options_.height, std::as_const(pixels_).data());
      }
      sets_in_.offer(loan);
      loan = {};
      recorder_.step();
    }
  }
  /// A step of the disk's stage may take long; what comes meanwhile is offered after it. A disk that is too slow is
  /// never idle.
  void settle(Instant end) {
    bool busy = true;
    while (busy) {
      busy = recorder_.step();
      busy |= keeper_.step(clock_.now());
      if (options_.stepped) options_.stepped();
      const std::string& problem = report().problem;
      if (!problem.empty() && (problems_.empty() || problems_.back() != problem)) problems_.push_back(problem);
      if (clock_.now() > end) break;
      offer_due();
    }
  }

  const Options options_;
  hal::sim::SimClock& clock_;
  const RigConfig config_;
  FrameRate rate_ = options_.rate;
  std::optional<std::int64_t> utc_ = kUtcNs;
  std::vector<Instant> times_;
  LoanPool<FrameSet> pool_{8};
  Outlet<SetLoan> sets_in_{Recorder::kSets, false};
  SpscRing<Raymap> raymaps_{4};
  EncodeStage encoder_{config_.raymap, clock_, raymaps_};
  Recorder recorder_;
  TakeKeeper keeper_;
  Instant next_set_at_;
  std::vector<std::uint8_t> pixels_;
  std::uint64_t next_ = 0;
  std::uint64_t ticket_ = 0;
  std::vector<std::string> problems_;
};

}  // namespace nodal::firmware
