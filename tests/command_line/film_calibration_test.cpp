// Films without a calibration: it is found in their own frames.
#include <unistd.h>

#include <array>

#include "film_command.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {
namespace {

/// Films of a rig of six fisheyes; in the first frames every head shows something else, and it moves.
class FilmsAlone : public FilmCommand {
 protected:
  static constexpr int kFineSide = 400;

  static const test::RenderedRig& fine() {
    static const test::RenderedRig rig = test::render_rig(test::six_fisheyes(kFineSide), hal::sim::town_square_scene(3),
                                                          {PixelFormat::kRgb24, 1.0, 5, 2});
    return rig;
  }
  /// `moving`, then `still` frames, at 10 frames a second.
  void write_fine(int moving, int still) {
    films_.clear();
    for (std::size_t h = 0; h < fine().bytes.size(); ++h) {
      const std::vector<std::uint8_t>& picture = fine().bytes[h];
      std::string raw;
      for (int f = 0; f < moving; ++f) {
        const std::size_t turn = 3 * kFineSide * (23 * h + 31) * static_cast<std::size_t>(f + 1) % picture.size();
        raw.append(picture.begin() + static_cast<std::ptrdiff_t>(turn), picture.end());
        raw.append(picture.begin(), picture.begin() + static_cast<std::ptrdiff_t>(turn));
      }
      for (int f = 0; f < still; ++f) raw.append(picture.begin(), picture.end());
      write("raw", raw);
      films_.push_back(path(name_of(h) + ".mkv"));
      ffmpeg({"-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", "400x400", "-framerate", "10", "-i", path("raw"),
              "-c:v", "ffv1", films_.back()});
    }
  }
  Words alone(const std::string& out, const Words& more) const {
    Words words{"--json", "stitch"};
    words.insert(words.end(), films_.begin(), films_.end());
    words.insert(words.end(), {"--codec", "ffv1", "--seams", "fixed", "--width", "128", "-o", path(out)});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

TEST_F(FilmsAlone, TheirCalibrationIsFoundWhereTheRigStandsStill) {
  write_fine(20, 10);
  // What a run that was killed has left, and a folder of somebody else's.
  std::array<char, 65> host{};
  ::gethostname(host.data(), host.size() - 1);
  const std::string left = "own.mkv.parts/frames.part-" + std::string(host.data()) + "-4194305";  // above any process
  std::filesystem::create_directories(path(left));
  std::filesystem::create_directories(path("own.mkv.parts/frames"));
  write(left + "/cam0.png", "half a picture");
  write("own.mkv.parts/frames/mine.png", "mine");
  const Finished run = nodal(alone("own.mkv", {"--times", "begin"}));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(parts("own.mkv"), std::vector<std::string>{"frames"});
  EXPECT_EQ(read("own.mkv.parts/frames/mine.png"), "mine");
  const Json answer = Json::parse(run.out);
  EXPECT_EQ(answer["still"]["placed"], 6);
  EXPECT_EQ(answer["still"]["verdict"], "good") << answer["still"];
  EXPECT_TRUE(std::filesystem::exists(path("own.jpg"))) << "a still to look at";
  EXPECT_TRUE(std::filesystem::exists(path("own.report.html")));
  const auto found = parse_calibration(read("own.rig.json"));
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(test::rotation_error(fine().truth, *found).max_deg, 0.3);
  // The calibration that was written makes the same film.
  films_.insert(films_.begin(), path("own.rig.json"));
  const Finished again = nodal(alone("given.mkv", {"--times", "begin"}));
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_FALSE(Json::parse(again.out).contains("still"));
  EXPECT_TRUE(pixels(path("given.mkv"), "rgb24") == pixels(path("own.mkv"), "rgb24"));
}

TEST_F(FilmsAlone, WhoseTimesAreNotKnown_KeepTheirCalibrationForTheNextRun) {
  write_fine(0, 30);
  const Finished first = nodal(alone("s.mkv", {}));
  EXPECT_NE(first.code, 0);
  EXPECT_NE(first.err.find("its time is not known"), std::string::npos) << first.err;
  EXPECT_NE(first.err.find("no calibration is given"), std::string::npos) << first.err;
  const Finished second = nodal(alone("s.mkv", {"--times", "begin"}));
  ASSERT_EQ(second.code, 0) << second.err;
  EXPECT_EQ(second.err.find("no calibration is given"), std::string::npos) << second.err;
  EXPECT_TRUE(std::filesystem::exists(path("s.mkv")));
}

TEST_F(FilmsAlone, WhoseRigNeverStandsStillAndWhoseTimesAreNotKnown_AreRefusedWithWhatToDo) {
  write_fine(20, 0);
  const Finished run = nodal(alone("s.mkv", {}));
  EXPECT_NE(run.code, 0);
  EXPECT_NE(run.err.find("keep the rig still for some seconds"), std::string::npos) << run.err;
  EXPECT_FALSE(std::filesystem::exists(path("s.mkv")));
  EXPECT_FALSE(std::filesystem::exists(path("s.rig.json")));
}

TEST_F(FilmsAlone, WhosePicturesAreSideBySide_AreSplit) {
  write_fine(0, 5);
  Words words;
  for (const std::string& film : films_) words.insert(words.end(), {"-i", film});
  words.insert(words.end(), {"-filter_complex", "[0][1][2]hstack=3[a];[3][4][5]hstack=3[b];[a][b]vstack", "-c:v",
                             "ffv1", path("beside.mkv")});
  ffmpeg(words);
  films_ = {path("beside.mkv")};
  const Finished run = nodal(alone("s.mkv", {"--split", "3x2"}));
  ASSERT_EQ(run.code, 0) << run.err;
  auto found = parse_calibration(read("s.rig.json"));
  ASSERT_TRUE(found) << found.error().text();
  ASSERT_EQ(found->heads.size(), 6u);
  for (std::size_t h = 0; h < 6; ++h) found->heads[h].name = fine().truth.heads[h].name;
  EXPECT_LT(test::rotation_error(fine().truth, *found).max_deg, 0.3);
  EXPECT_NE(ffprobe("stream=nb_read_packets,nb_frames,width", path("s.mkv")).find("width=128"), std::string::npos);
}

TEST_F(FilmsAlone, OneFilmWithOneTrack_IsNoRig) {
  write_fine(1, 0);
  films_.resize(1);
  const Finished run = nodal(alone("s.mkv", {}));
  EXPECT_NE(run.code, 0);
  EXPECT_NE(run.err.find("give a film of each head"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace nodal::command_line
