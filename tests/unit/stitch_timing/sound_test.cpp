// Lags from sound that was computed for two clocks.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "recordings.h"
#include "stitch/timing/sound_lag.h"

namespace nodal::timing {
namespace {

using recordings::Clock;

SoundTrack track(const std::vector<double>& samples, int rate, double start = 0) {
  auto reducer = SoundReducer::make(rate);
  if (!reducer) ADD_FAILURE() << reducer.error().text();
  // Blocks of odd lengths, as decoders give them.
  for (std::size_t i = 0; i < samples.size(); i += 4801) {
    (void)reducer->add(std::span(samples).subspan(i, std::min<std::size_t>(4801, samples.size() - i)));
  }
  return *std::move(*reducer).finish(start);
}

struct Pair {
  Clock a{}, b{};
  int rate_a = 16000, rate_b = 16000;
  double seconds = 40;
  double noise = 0.1;  ///< as loud as the sound: coherence about 0.5
  std::uint32_t seed = 1;
};

Result<Lag> measured(const Pair& pair, const recordings::Sound& sound) {
  const auto a = recordings::recorded(sound, pair.a, pair.rate_a, pair.seconds, pair.noise, pair.seed + 100);
  const auto b = recordings::recorded(sound, pair.b, pair.rate_b, pair.seconds, pair.noise, pair.seed + 200);
  return sound_lag(track(a, pair.rate_a), track(b, pair.rate_b), {});
}

TEST(SoundReducer, RateThatCannotBeUsed_IsRefused) {
  EXPECT_FALSE(SoundReducer::make(8000));
  EXPECT_FALSE(SoundReducer::make(1000000));
  EXPECT_TRUE(SoundReducer::make(11025));
}

TEST(SoundReducer, AnyRate_KeepsDurationAndStart) {
  for (const int rate : {11025, 16000, 44100, 48000, 96000}) {
    const auto tone = track(recordings::recorded(recordings::speech(-1, 6, 3), {}, rate, 4, 0, 1), rate, 2.5);
    EXPECT_NEAR(tone.end(), 6.5, 0.01) << rate;
    EXPECT_EQ(tone.start(), 2.5);
  }
}

TEST(SoundReducer, BlocksOfAnySize_TheSameTrack) {
  const auto samples = recordings::recorded(recordings::speech(-1, 6, 3), {}, 44100, 4, 0.1, 1);
  auto whole = SoundReducer::make(44100), pieces = SoundReducer::make(44100);
  ASSERT_TRUE(whole->add(samples));
  for (std::size_t at = 0, size = 1; at < samples.size(); at += size, size = size * 7 % 10007) {
    ASSERT_TRUE(pieces->add(std::span(samples).subspan(at, std::min(size, samples.size() - at))));
  }
  const auto a = *std::move(*whole).finish(0), b = *std::move(*pieces).finish(0);
  ASSERT_EQ(a.count(), b.count());
  EXPECT_EQ(*a.samples(0, a.count()), *b.samples(0, b.count()));
  EXPECT_EQ(a.samples(-5, 10)->size(), 5u);
  EXPECT_EQ(a.samples(a.count() - 3, 10)->size(), 3u);
}

/// Counts the samples that are asked for at once.
class CountingStore final : public SoundStore {
 public:
  Status append(std::span<const float> samples) override {
    largest_ = std::max(largest_, samples.size());
    return store_.append(samples);
  }
  Status read(std::int64_t first, std::span<float> into) const override {
    largest_ = std::max(largest_, into.size());
    return store_.read(first, into);
  }
  std::size_t largest() const { return largest_; }

 private:
  MemoryStore store_;
  mutable std::size_t largest_ = 0;
};

TEST(SoundLag, LongSound_IsReadInPieces) {
  std::size_t largest[2] = {};
  for (const int times : {1, 4}) {
    const auto sound = recordings::speech(-5, 40 + 60.0 * times, 7);
    auto store = std::make_shared<CountingStore>(), other = std::make_shared<CountingStore>();
    const auto reduced = [&](const std::shared_ptr<SoundStore>& into, const Clock& clock) {
      auto reducer = SoundReducer::make(16000, into);
      const auto samples = recordings::recorded(sound, clock, 16000, 20 + 60.0 * times, 0.1, 3);
      for (std::size_t at = 0; at < samples.size(); at += 16000) {
        (void)reducer->add(std::span(samples).subspan(at, std::min<std::size_t>(16000, samples.size() - at)));
      }
      return *std::move(*reducer).finish(0);
    };
    const auto a = reduced(store, {}), b = reduced(other, {0.5, 50});
    ASSERT_TRUE(sound_lag(a, b, {.expected = 0, .reach = 5}));
    largest[times / 4] = std::max(store->largest(), other->largest());
  }
  EXPECT_LE(largest[0], 21u * kBandRate);
  EXPECT_LE(largest[1], 21u * kBandRate) << "memory grows with the sound";
}

TEST(SoundLag, SpeechInNoiseAndClocksApart_LagAndRateAreTrue) {
  const auto sound = recordings::speech(-5, 60, 7);
  const Pair pair{.a = {0.3, -40}, .b = {-1.9371, 60}};
  const auto lag = measured(pair, sound);
  ASSERT_TRUE(lag) << lag.error().text();
  for (const double at : {0.0, 20.0, 40.0}) {
    EXPECT_NEAR(lag->value(at), true_lag(pair.a, pair.b, at), 0.05e-3) << at;
    EXPECT_NEAR(lag->value(at), true_lag(pair.a, pair.b, at), 5 * lag->sigma(at)) << at;
  }
  EXPECT_NEAR(lag->rate, true_rate(pair.a, pair.b), 1e-6);
  EXPECT_LT(std::sqrt(lag->rate_variance), 1e-6);
}

TEST(SoundLag, DifferentRates_LagIsTrue) {
  const auto sound = recordings::speech(-5, 50, 8);
  const Pair pair{.a = {0, 100}, .b = {3.123, -100}, .rate_a = 44100, .rate_b = 48000, .seconds = 30};
  const auto lag = measured(pair, sound);
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_NEAR(lag->value(15), true_lag(pair.a, pair.b, 15), 0.05e-3);
  EXPECT_NEAR(lag->rate, true_rate(pair.a, pair.b), 2e-6);
}

TEST(SoundLag, StartsOfTheTracks_AreCounted) {
  const auto sound = recordings::speech(-5, 40, 9);
  const auto a = track(recordings::recorded(sound, {}, 16000, 20, 0.05, 1), 16000, 100);
  const auto b = track(recordings::recorded(sound, {0.25, 0}, 16000, 20, 0.05, 2), 16000, 250);
  const auto lag = sound_lag(a, b, {.expected = 150, .reach = 2});
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_NEAR(lag->value(110), 149.75, 0.05e-3);
}

TEST(SoundLag, Silence_IsRefused) {
  const auto lag = measured({.noise = 1e-6}, recordings::Sound{0, std::vector<double>(10, 0.0)});
  ASSERT_FALSE(lag);
  EXPECT_EQ(lag.error().code, Errc::kNotDetermined);
  EXPECT_NE(lag.error().message.find("silent"), std::string::npos) << lag.error().message;
}

TEST(SoundLag, NoiseOfTheirOwn_IsRefused) {
  const auto lag = measured({.noise = 0.1}, recordings::Sound{0, std::vector<double>(10, 0.0)});
  ASSERT_FALSE(lag);
  EXPECT_NE(lag.error().message.find("in common"), std::string::npos) << lag.error().message;
}

TEST(SoundLag, LoopOfMusic_IsRefusedAsRepeating) {
  const auto lag = measured({.b = {0.1, 10}, .noise = 0.02}, recordings::loop_of(-5, 60, 1.875, 4));
  ASSERT_FALSE(lag);
  EXPECT_NE(lag.error().message.find("repeats"), std::string::npos) << lag.error().message;
}

TEST(SoundLag, HumOnly_IsRefused) {
  const auto lag = measured({.b = {0.1033, 10}, .noise = 1e-3}, recordings::hum(-5, 60));
  EXPECT_FALSE(lag);
}

TEST(SoundLag, SpeechUnderHumThatIsLouder_LagIsTrue) {
  auto sound = recordings::speech(-5, 60, 11);
  const auto under = recordings::hum(-5, 60);
  for (std::size_t i = 0; i < sound.samples.size(); ++i)
    sound.samples[i] = 0.3 * sound.samples[i] + 2 * under.samples[i];
  const Pair pair{.a = {0, 0}, .b = {-0.777, 15}, .noise = 0.01};
  const auto lag = measured(pair, sound);
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_NEAR(lag->value(20), true_lag(pair.a, pair.b, 20), 0.1e-3);
}

TEST(SoundLag, MicrophoneWiredTheOtherWayRound_LagIsTrue) {
  const auto sound = recordings::speech(-5, 40, 14);
  auto b = recordings::recorded(sound, {0.5, 0}, 16000, 20, 0.02, 2);
  for (double& x : b) x = -x;
  const auto lag = sound_lag(track(recordings::recorded(sound, {}, 16000, 20, 0.02, 1), 16000), track(b, 16000), {});
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_NEAR(lag->value(10), -0.5, 0.05e-3);
}

TEST(SoundLag, FilmPausedInTheMiddle_IsRefused) {
  const auto sound = recordings::speech(-5, 60, 12);
  const auto a = recordings::recorded(sound, {}, 16000, 40, 0.02, 1);
  auto b = recordings::recorded(sound, {}, 16000, 40, 0.02, 2);
  b.erase(b.begin() + 16000 * 20, b.begin() + 16000 * 21);
  const auto lag = sound_lag(track(a, 16000), track(b, 16000), {});
  ASSERT_FALSE(lag);
  EXPECT_NE(lag.error().message.find("paused"), std::string::npos) << lag.error().message;
}

TEST(SoundLag, OverlapOfAFewSeconds_IsRefused) {
  const auto sound = recordings::speech(-5, 40, 13);
  const auto a = track(recordings::recorded(sound, {}, 16000, 20, 0.02, 1), 16000);
  const auto b = track(recordings::recorded(sound, {15, 0}, 16000, 20, 0.02, 2), 16000);
  EXPECT_FALSE(sound_lag(a, b, {.expected = -15, .reach = 1}));
}

TEST(SoundLag, ManyDraws_ErrorsAreAsLargeAsClaimed) {
  double lag_squares = 0, rate_squares = 0;
  constexpr int kDraws = 12;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    const auto sound = recordings::speech(-4, 40, 1000 + i);
    const Pair pair{.a = {0, 20.0 - i}, .b = {1.1 - 0.1 * i, 3.0 * i}, .seconds = 30, .noise = 0.15, .seed = 10 * i};
    const auto lag = measured(pair, sound);
    ASSERT_TRUE(lag) << lag.error().text();
    const double error = lag->value(lag->at) - true_lag(pair.a, pair.b, lag->at);
    const double rate_error = lag->rate - true_rate(pair.a, pair.b);
    lag_squares += error * error / lag->lag_variance / kDraws;
    rate_squares += rate_error * rate_error / lag->rate_variance / kDraws;
  }
  // Mean of 12 squares: 1 +- 0.4.
  EXPECT_LT(lag_squares, 2.6);
  EXPECT_GT(lag_squares, 0.2);
  EXPECT_LT(rate_squares, 2.6);
  EXPECT_GT(rate_squares, 0.2);
}

}  // namespace
}  // namespace nodal::timing
