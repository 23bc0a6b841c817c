// Clocks of all heads from lags whose truth is known.
#include "stitch/timing/film_times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "recordings.h"

namespace nodal::timing {
namespace {

using recordings::Clock;

/// A lag as a source measures it: true, but for errors as large as its variances.
PairLag pair(int a, int b, const std::vector<Clock>& clocks, double lag_sigma, double rate_sigma, std::mt19937& random,
             Source source = Source::kSound) {
  std::normal_distribution<double> normal;
  const auto& ca = clocks[static_cast<std::size_t>(a)];
  const auto& cb = clocks[static_cast<std::size_t>(b)];
  Lag lag{.at = 30, .lag = true_lag(ca, cb, 30) + lag_sigma * normal(random)};
  lag.rate = true_rate(ca, cb) + rate_sigma * normal(random);
  lag.lag_variance = lag_sigma * lag_sigma;
  lag.rate_variance = rate_sigma * rate_sigma;
  lag.measured = lag.used = 10;
  return {a, b, source, lag};
}

std::vector<HeadFilm> films(int count) {
  std::vector<HeadFilm> heads;
  for (int i = 0; i < count; ++i) heads.push_back({"cam" + std::to_string(i), 0, 60, std::nullopt});
  return heads;
}

std::vector<PairLag> all_pairs(const std::vector<Clock>& clocks, std::mt19937& random, double lag_sigma = 20e-6,
                               double rate_sigma = 0.5e-6) {
  std::vector<PairLag> lags;
  for (int a = 0; a < static_cast<int>(clocks.size()); ++a) {
    for (int b = a + 1; b < static_cast<int>(clocks.size()); ++b) {
      lags.push_back(pair(a, b, clocks, lag_sigma, rate_sigma, random));
    }
  }
  return lags;
}

std::string refusal(const Result<FilmTimes>& times) { return times ? "accepted" : times.error().message; }

const std::vector<Clock> kFour{{0, 0}, {1.5, 40}, {-2.25, -80}, {0.125, 100}};

TEST(FilmTimes, LagsThatAreExact_GiveTheClocks) {
  std::mt19937 random(1);
  const auto times = film_times(films(4), all_pairs(kFour, random, 1e-9, 1e-12), {}, {});
  ASSERT_TRUE(times) << times.error().text();
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(times->heads[i].offset, kFour[i].offset, 2e-6);
    EXPECT_NEAR(times->heads[i].ppm, kFour[i].ppm, 0.02);
  }
  EXPECT_LT(times->residual, 1e-6);
  EXPECT_EQ(times->heads[0].sources, "");
  EXPECT_EQ(times->heads[1].sources, "sound");
  EXPECT_TRUE(times->notes.empty());
}

TEST(FilmTimes, AnyReference_TimesAreItsTimes) {
  std::mt19937 random(2);
  const auto times = film_times(films(4), all_pairs(kFour, random, 1e-9, 1e-12), {}, {.reference = 2});
  ASSERT_TRUE(times) << times.error().text();
  EXPECT_EQ(times->heads[2].offset, 0);
  for (std::size_t i = 0; i < 4; ++i) {
    const double expected = kFour[2].head_time(kFour[i].true_time(50));
    EXPECT_NEAR(times->heads[i].offset + (1 + times->heads[i].ppm * 1e-6) * 50, expected, 5e-6);
  }
}

TEST(FilmTimes, OneLagWrongAmongFourHeads_IsNamedAndLeftOut) {
  std::mt19937 random(3);
  auto lags = all_pairs(kFour, random);
  lags[4].lag.lag += 0.5;  // cam1, cam3
  const auto times = film_times(films(4), lags, {}, {});
  ASSERT_TRUE(times) << times.error().text();
  ASSERT_EQ(times->notes.size(), 1u);
  EXPECT_NE(times->notes[0].find("sound of heads 'cam1' and 'cam3'"), std::string::npos) << times->notes[0];
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(times->heads[i].offset, kFour[i].offset, 0.2e-3);
}

TEST(FilmTimes, TriangleThatDoesNotClose_IsRefused) {
  std::mt19937 random(4);
  auto lags = all_pairs({{0, 0}, {1, 10}, {2, 20}}, random);
  lags[1].lag.lag += 0.02;
  const auto times = film_times(films(3), lags, {}, {});
  EXPECT_NE(refusal(times).find("contradict"), std::string::npos) << refusal(times);
  EXPECT_NE(refusal(times).find("--offset"), std::string::npos);
}

TEST(FilmTimes, TwoSourcesThatDisagree_AreRefusedAndThoseThatAgreeAreNamed) {
  std::mt19937 random(5);
  const std::vector<Clock> clocks{{0, 0}, {1, 10}};
  std::vector<PairLag> lags{pair(0, 1, clocks, 20e-6, 1e-6, random),
                            pair(0, 1, clocks, 0.5e-3, 20e-6, random, Source::kRotation)};
  const auto agree = film_times(films(2), lags, {}, {});
  ASSERT_TRUE(agree) << agree.error().text();
  EXPECT_EQ(agree->heads[1].sources, "sound and rotation");
  lags[1].lag.lag += 0.040;  // one frame
  EXPECT_NE(refusal(film_times(films(2), lags, {}, {})).find("contradict"), std::string::npos);
}

TEST(FilmTimes, HeadWithoutALag_IsRefusedWithWhatItsSourcesSaid) {
  std::mt19937 random(6);
  const std::vector<PairLag> lags{pair(0, 1, kFour, 20e-6, 1e-6, random)};
  const std::vector<NoLag> missing{{0, 2, Source::kSound, "the sound is silent"}};
  const auto text = refusal(film_times(films(3), lags, missing, {}));
  EXPECT_NE(text.find("'cam2'"), std::string::npos) << text;
  EXPECT_NE(text.find("sound: the sound is silent"), std::string::npos) << text;
  EXPECT_NE(text.find("--offset cam2=SECONDS"), std::string::npos) << text;
}

TEST(FilmTimes, LagThatIsNotSure_IsRefused) {
  std::mt19937 random(7);
  const auto text = refusal(film_times(films(2), std::vector{pair(0, 1, kFour, 8e-3, 1e-6, random)}, {}, {}));
  EXPECT_NE(text.find("ms are needed"), std::string::npos) << text;
}

TEST(FilmTimes, FilmOfAnotherTake_IsRefusedByItsContainer) {
  std::mt19937 random(8);
  auto heads = films(2);
  heads[1].container = 100;
  const auto lags = std::vector{pair(0, 1, kFour, 20e-6, 1e-6, random)};
  EXPECT_NE(refusal(film_times(heads, lags, {}, {})).find("same take"), std::string::npos);
  heads[1].container = 3;  // wrong by 1.5 s, as containers are
  EXPECT_TRUE(film_times(heads, lags, {}, {}));
}

TEST(FilmTimes, SingleFlash_CountsOnlyWithAnotherSource) {
  std::mt19937 random(9);
  auto flash = pair(0, 1, kFour, 0.3e-3, 100e-6, random, Source::kFlash);
  flash.lag.used = 1;
  EXPECT_NE(refusal(film_times(films(2), std::vector{flash}, {}, {})).find("not known"), std::string::npos);
  const auto both =
      film_times(films(2), std::vector{flash, pair(0, 1, kFour, 1e-3, 5e-6, random, Source::kRotation)}, {}, {});
  ASSERT_TRUE(both) << both.error().text();
  EXPECT_EQ(both->heads[1].sources, "rotation and flash");
}

TEST(FilmTimes, NumbersThatCannotBe_AreRefused) {
  std::mt19937 random(10);
  const auto good = pair(0, 1, kFour, 20e-6, 1e-6, random);
  auto same = good, beyond = good, endless = good, negative = good;
  same.b = 0, beyond.b = 7, endless.lag.lag = std::nan(""), negative.lag.lag_variance = -1;
  for (const PairLag& bad : {same, beyond, endless, negative}) {
    const auto times = film_times(films(2), std::vector{bad}, {}, {});
    ASSERT_FALSE(times);
    EXPECT_EQ(times.error().code, Errc::kBadValue);
  }
  EXPECT_FALSE(film_times(films(2), std::vector{good}, {}, {.reference = 2}));
}

TEST(FilmTimes, ManyDraws_ErrorsAreAsLargeAsClaimed) {
  // Errors that a source has at each head (0.3 ms for sound) are drawn, too.
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  double squares = 0, rates = 0;
  constexpr int kDraws = 200;
  for (int i = 0; i < kDraws; ++i) {
    auto shifted = kFour;
    for (Clock& c : shifted) c.offset += 0.3e-3 * normal(random);
    const auto times = film_times(films(4), all_pairs(shifted, random, 0.2e-3, 2e-6), {}, {});
    ASSERT_TRUE(times) << times.error().text();
    const HeadTime& head = times->heads[3];
    const double at_end = head.offset + 60 * head.ppm * 1e-6 - kFour[3].offset - 60 * kFour[3].ppm * 1e-6;
    squares += at_end * at_end / (head.sigma * head.sigma) / kDraws;
    rates += std::pow((head.ppm - kFour[3].ppm) / head.ppm_sigma, 2) / kDraws;
  }
  // Mean of 200 squares: 1 +- 0.1. The sigma is the larger of both ends' ones.
  EXPECT_NEAR(squares, 1, 0.35);
  EXPECT_NEAR(rates, 1, 0.35);
}

}  // namespace
}  // namespace nodal::timing
