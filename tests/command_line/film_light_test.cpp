// `nodal stitch` with films whose heads are not equally bright.
#include <cmath>

#include "film_command.h"

namespace nodal::command_line {
namespace {

class FilmLight : public FilmCommand {
 protected:
  static constexpr std::size_t kFrame = 128 * 64 * 3;

  /// Films of the town with each head's light times 2^stops(head, frame); its response is linear.
  template <class Stops>
  void write_lit(int frames, const Stops& stops) {
    films_.clear();
    for (std::size_t h = 0; h < town().bytes.size(); ++h) {
      std::string raw;
      for (int f = 0; f < frames; ++f) {
        const double gain = 0.4 * std::exp2(stops(h, f));
        for (const std::uint8_t level : town().bytes[h]) {
          raw += static_cast<char>(static_cast<std::uint8_t>(std::min(255L, std::lround(level * gain))));
        }
      }
      films_.push_back(path(name_of(h) + ".mkv"));
      ffmpeg({"-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", "160x160", "-framerate", "30", "-i",
              write("raw", raw), "-c:v", "ffv1", films_.back()});
    }
  }
  Words how(const Words& more = {}) const {
    Words words{"--codec", "ffv1", "--seams", "fixed", "--width", "128"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::string stitched(const std::string& out, const Words& more = {}) const {
    expect_good(stitch(out, how(more)));
    return pixels(path(out), "rgb24");
  }
  /// Mean difference of all samples, levels.
  static double apart(const std::string& a, const std::string& b) {
    double sum = 0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      sum += std::abs(static_cast<std::uint8_t>(a[k]) - static_cast<std::uint8_t>(b[k]));
    }
    return sum / static_cast<double>(a.size());
  }
};

/// Stops of each head's light at the end of the film; their mean is zero.
constexpr std::array kDrift{0.6, -0.6, 0.3, -0.3, 0.4, -0.4};

TEST_F(FilmLight, ExposuresThatDriftApart_AreMatchedSmoothly) {
  constexpr int kFrames = 60;
  write_lit(kFrames, [](std::size_t, int) { return 0.0; });
  const std::string even = stitched("even.mkv");
  write_lit(kFrames, [&](std::size_t h, int f) { return kDrift[h] * f / (kFrames - 1); });
  const std::string fixed = stitched("fixed.mkv", {"--light", "fixed"});
  const Finished said = nodal(stitch("matched.mkv", how()));
  ASSERT_EQ(said.code, 0) << said.err;
  EXPECT_NE(said.err.find(films_[0] + ": it is +0."), std::string::npos) << said.err;
  const std::string matched = pixels(path("matched.mkv"), "rgb24");
  ASSERT_EQ(matched.size(), kFrames * kFrame);
  for (const int f : {0, 15, 30, 45, 59}) {
    const std::size_t at = static_cast<std::size_t>(f) * kFrame;
    const std::string wanted = even.substr(at, kFrame);
    // Of values from 0 to 255, whose differences at the end are those of 1.2 stops.
    EXPECT_LT(apart(matched.substr(at, kFrame), wanted), 1.5) << "frame " << f;
    if (f > 25) {
      EXPECT_GT(apart(fixed.substr(at, kFrame), wanted), 3) << "frame " << f;
    }
  }
  double before = 0;
  for (int f = 0; f < kFrames; ++f) {
    double sum = 0;
    for (std::size_t k = 0; k < kFrame; ++k) {
      sum += static_cast<std::uint8_t>(matched[static_cast<std::size_t>(f) * kFrame + k]);
    }
    const double mean = sum / kFrame;
    if (f > 0) {
      EXPECT_LT(std::abs(mean - before), 0.3) << "frame " << f;
    }
    before = mean;
  }
}

TEST_F(FilmLight, ExposuresThatDriftApart_TheSameBytesInEveryShard) {
  write_lit(250, [&](std::size_t h, int f) { return kDrift[h] * f / 249; });
  expect_good(stitch("one.mkv", how()));
  for (const char* const shard : {"1", "0"}) expect_good(stitch("shards.mkv", how({"--segments", shard})));
  expect_good(stitch("shards.mkv", how({"--join"})));
  EXPECT_TRUE(read("shards.mkv") == read("one.mkv"));
}

TEST_F(FilmLight, NothingToMatchOrAFlashInOneHead_TheSameBytesAsWithout) {
  write_lit(100, [](std::size_t, int) { return 0.0; });
  const std::string fixed = stitched("fixed.mkv", {"--light", "fixed"});
  EXPECT_TRUE(stitched("matched.mkv") == fixed);
  constexpr int kFlash = 48;  // one of the frames that are measured: every 12th
  write_lit(100, [](std::size_t h, int f) { return h == 2 && f == kFlash ? 1.0 : 0.0; });
  const std::string flash = stitched("flash.mkv");
  ASSERT_EQ(flash.size(), fixed.size());
  for (int f = 0; f < 100; ++f) {
    const std::size_t at = static_cast<std::size_t>(f) * kFrame;
    EXPECT_EQ(flash.substr(at, kFrame) == fixed.substr(at, kFrame), f != kFlash) << "frame " << f;
  }
}

}  // namespace
}  // namespace nodal::command_line
