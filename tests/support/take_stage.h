// The recorder and the disk's stage on any disk, in virtual time: sets come at their times, also while the disk is busy.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/record/recorder.h"
#include "firmware/record/take_keeper.h"
#include "hal/disk.h"
#include "hal/sim/clock.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {

/// The pictures are grey, and begin with the number of their set.
class TakeStage {
 public:
  static constexpr int kStageHeads = 2;
  struct Options {
    TakesConfig takes{.folder = "takes", .buffer_mb = 16, .raymap = false};
    FrameRate rate{5, 1};
    int width = 32;  ///< of the pictures, px
    int height = 16;
    std::array<TakeMode, kStageHeads> modes{};  ///< of the heads
    hal::ConfinedPort* confined = nullptr;      ///< where takes are recovered
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
            config_, disk, recorder_, "a test", [&clock] { return kUtcNs + clock.now().ns(); }, nullptr, nullptr,
            options.confined),
        next_set_at_(clock.now()),
        pixels_(static_cast<std::size_t>(options.width * options.height), 90) {
    settle(clock_.now());
  }

  void request(TakeCommand what) { EXPECT_TRUE(keeper_.requests().push({++ticket_, std::move(what)})); }
  /// What the stage answers next. Sets go on coming.
  TakeAnswer next_answer() {
    for (int k = 0; k < 10'000; ++k) {
      if (auto answer = keeper_.answers().pop()) return std::move(*answer);
      run(options_.rate.period());
    }
    ADD_FAILURE() << "no answer";
    return {0, fail(Errc::kTimeout, "no answer")};
  }
  TakeAnswer ask(TakeCommand what) {
    request(std::move(what));
    return next_answer();
  }
  TakeAnswer start(bool still = false) {
    TakeRequest::Start start;
    start.still = still;
    for (std::size_t k = 0; k < kStageHeads; ++k)
      start.heads.push_back(HeadShape{PixelFormat::kGrey8, options_.width, options_.height});
    return ask(std::move(start));
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
  /// Ends as nodald does.
  void close() { keeper_.close(clock_.now()); }
  const TakeReport& report() { return keeper_.snapshot().read(); }
  /// What the report said, in order.
  const std::vector<std::string>& problems() const { return problems_; }
  std::uint64_t offered() const { return next_; }
  Recorder& recorder() { return recorder_; }

  static constexpr std::int64_t kUtcNs = 1'700'000'000'000'000'000;

 private:
  static RigConfig config(const Options& options) {
    RigConfig config;
    config.name = "test";
    config.rate = options.rate;
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
    for (; next_set_at_ <= clock_.now(); next_set_at_ = next_set_at_ + options_.rate.period()) {
      SetLoan loan = pool_.take();
      ASSERT_TRUE(loan);
      FrameSet& set = loan.edit();
      set = {};
      set.number = next_++;
      set.mid_exposure = next_set_at_;
      set.rate = options_.rate;
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
  /// A step of the disk's stage may take long; what comes meanwhile is offered after it. A disk that is too slow is never idle.
  void settle(Instant end) {
    bool busy = true;
    while (busy) {
      busy = recorder_.step();
      busy |= keeper_.step(clock_.now());
      const std::string& problem = report().problem;
      if (!problem.empty() && (problems_.empty() || problems_.back() != problem)) problems_.push_back(problem);
      if (clock_.now() > end) break;
      offer_due();
    }
  }

  const Options options_;
  hal::sim::SimClock& clock_;
  const RigConfig config_;
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

/// What the evidence of a take says, read whole: an index for every set, and a gap for every set that is not there.
struct TakeAccount {
  std::uint64_t sets = 0;
  std::uint64_t missed = 0;  ///< between the first and the last, said by the sets
  std::uint64_t end = 0;     ///< index behind the last set
  std::uint64_t cut = 0;     ///< between segments, after a failed sync
  std::vector<std::pair<std::uint64_t, std::uint64_t>> segments{};  ///< first set, and behind the last
};
/// `most`: segments that are read.
inline TakeAccount account_of(hal::DiskPort& disk, std::uint64_t take, std::size_t most = ~std::size_t{0}) {
  TakeAccount account;
  const std::string folder = take::take_folder(take);
  std::optional<std::uint64_t> next;
  for (const std::string& name : disk.list(folder).value_or(std::vector<std::string>())) {
    if (!name.starts_with("evidence-") || account.segments.size() == most) continue;
    const auto bytes = disk.read(folder + "/" + name, take::kMaxEvidenceBytes);
    const auto segment = take::read_evidence(bytes.value_or(std::vector<std::uint8_t>()), name);
    EXPECT_TRUE(segment) << segment.error().text();
    if (!segment) continue;
    EXPECT_TRUE(segment->end.has_value()) << name;
    EXPECT_EQ(segment->good_bytes, bytes->size()) << name;
    EXPECT_GE(segment->begin.first_set(), account.end) << name;
    const std::uint64_t deleted = segment->begin.first_set() - account.end;
    for (const take::wire::Set& set : segment->sets) {
      const bool begins = set.index() == segment->begin.first_set();
      const std::uint64_t expected = next ? *next + set.missed() + (begins ? deleted : 0) : set.number();
      EXPECT_GE(set.number(), expected) << name;
      const bool may_be_cut = begins && deleted == 0;
      EXPECT_TRUE(may_be_cut || set.number() == expected) << name << " set " << set.index();
      account.cut += set.number() - expected;
      next = set.number() + 1;
      account.missed += set.missed();
    }
    account.sets += segment->sets.size();
    account.end = segment->next_set();
    account.segments.emplace_back(segment->begin.first_set(), segment->next_set());
  }
  return account;
}

}  // namespace nodal::firmware
