// Times of heads that separate cameras filmed: sound, motion, gyros, flashes, and what is refused.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "film_command.h"

namespace nodal::command_line {
namespace {

/// Films of 12 s whose sound is `source` (of ffmpeg's lavfi), from `begins[head]` seconds on.
class FilmsWithSound : public FilmCommand {
 protected:
  void write_heard(const std::string& source, const std::vector<std::string>& begins) {
    write_films(120, ".mkv", kLossless, "10");
    heard_ = true;
    ffmpeg({"-f", "lavfi", "-i", source, "-c:a", "pcm_s16le", path("all.wav")});
    for (std::size_t h = 0; h < films_.size(); ++h) {
      const std::string heard = path(name_of(h) + "_heard.mkv");
      ffmpeg({"-i", films_[h], "-ss", begins[h], "-t", "12", "-i", path("all.wav"), "-map", "0:v", "-map", "1:a",
              "-c:v", "copy", "-c:a", "pcm_s16le", heard});
      films_[h] = heard;
    }
  }
  Words stitch_json(const std::string& out, const Words& more) const {
    Words words = stitch(out, more);
    words.insert(words.begin(), "--json");
    return words;
  }
  /// Seconds that a note says of a head.
  double said(const std::string& notes, std::size_t head) const {
    const std::string begin = "head '" + name_of(head) + "': ";
    const std::size_t at = notes.find(begin);
    return at == std::string::npos ? 1e9 : std::stod(notes.substr(at + begin.size()));
  }
};

TEST_F(FilmsWithSound, CamerasThatWereStartedOneByOne_TheirTimesAreHeard) {
  const std::vector<std::string> begins{"1.0", "1.35", "0.58", "1.0", "2.207", "0.9"};
  write_heard("anoisesrc=c=pink:seed=7:d=16:r=48000,tremolo=f=3:d=0.8", begins);
  const Words how{"--codec", "ffv1", "--seams", "fixed", "--width", "128"};
  const Finished run = nodal(stitch("heard.mkv", how));
  ASSERT_EQ(run.code, 0) << run.err;
  for (std::size_t h = 1; h < begins.size(); ++h) {
    EXPECT_NEAR(said(run.err, h), 1.0 - std::stod(begins[h]), 5e-4) << run.err;
  }
  const Json times = Json::parse(nodal(stitch_json("times.mkv", how)).out);
  for (std::size_t h = 1; h < begins.size(); ++h) {
    EXPECT_NEAR(times["heads"][h]["offset_s"], 1.0 - std::stod(begins[h]), 5e-4);
    EXPECT_EQ(times["heads"][h]["by"], "sound");
    EXPECT_GT(times["heads"][h]["sigma_ms"], 0.01);
    EXPECT_LE(times["heads"][h]["farthest_ms"], 50.1);
  }
  // A head whose time is given is not asked.
  Words given = how;
  given.insert(given.end(), {"--offset", name_of(2) + "=0.1"});
  const Finished some = nodal(stitch("given.mkv", given));
  ASSERT_EQ(some.code, 0) << some.err;
  EXPECT_EQ(said(some.err, 2), 1e9) << some.err;
  EXPECT_NEAR(said(some.err, 4), -1.207, 5e-4) << some.err;
  // The others keep their places where the first one's time is given.
  Words moved = how;
  moved.insert(moved.end(), {"--offset", name_of(0) + "=0.5"});
  const Json first = Json::parse(nodal(stitch_json("moved.mkv", moved)).out);
  EXPECT_EQ(first["heads"][0]["by"], "--offset");
  EXPECT_NEAR(first["heads"][4]["offset_s"], 0.5 - 1.207, 5e-4);
}

TEST_F(FilmsWithSound, SoundThatTellsNoTime_IsRefusedWithWhatToDo) {
  // The same beat twice a second: every lag of half a second fits.
  write_heard("aevalsrc='sin(6283*t)*lt(mod(t,0.5),0.02)':s=48000:d=16", {"1.0", "1.3", "0.5", "1.0", "2.2", "0.9"});
  expect_no_film(stitch("beat.mkv", {"--width", "128"}), "or give --offset", "beat.mkv");
  expect_no_film(stitch("beat.mkv", {"--width", "128"}), "--times begin", "beat.mkv");
  expect_good(stitch("begin.mkv", {"--width", "128", "--times", "begin"}));
}

TEST_F(FilmsWithSound, ClockThatRunsFaster_ItsSoundLastsAsLongAsThePicture) {
  // Bursts at 0.5, 1.5, ... 10.5 s of the first head's clock, which runs 0.5 % fast.
  write_heard("aevalsrc='0.8*sin(6283*t)*lt(mod(t+0.5,1),0.002)':s=48000:d=16", {"0", "0", "0", "0", "0", "0"});
  const Words how{"--codec", "ffv1",    "--seams", "fixed",    "--width",
                  "128",     "--times", "begin",   "--offset", name_of(0) + "=0,5000"};
  expect_good(stitch("s.mkv", how));
  ffmpeg({"-i", path("s.mkv"), "-map", "0:a:0", "-ac", "1", "-f", "s16le", path("pcm")});
  const std::string pcm = read("pcm");
  std::vector<double> bursts;
  for (std::size_t k = 0; 2 * k + 1 < pcm.size(); ++k) {
    const auto level = static_cast<std::int16_t>(static_cast<std::uint8_t>(pcm[2 * k]) |
                                                 static_cast<std::uint8_t>(pcm[2 * k + 1]) << 8);
    const double time = static_cast<double>(k) / 48000;
    if (std::abs(level) > 8000 && (bursts.empty() || time > bursts.back() + 0.5)) bursts.push_back(time);
  }
  ASSERT_GE(bursts.size(), 11u);
  for (std::size_t k = 1; k < 11; ++k) {
    EXPECT_NEAR(bursts[k] - bursts[0], static_cast<double>(k) / 1.005, 0.3e-3) << k;
  }
}

/// A town that is turned: frames of 160 px by ffmpeg's v360, which shares no code with Nodal.
class FilmsInMotion : public FilmsWithSound {
 protected:
  static double yaw(double t) {
    const double turn = 2 * std::numbers::pi * t;
    return 7 * std::sin(0.61 * turn + 0.4) + 4 * std::sin(1.13 * turn + 1.9) +
           2.2 * std::sin(2.07 * turn + 0.05 * t * t);
  }
  void write_turning(const std::vector<double>& begins) {
    ffmpeg(
        {"-f", "lavfi", "-i", "cellauto=rule=30:s=512x256:random_seed=3,gblur=1.5", "-frames:v", "1", path("e.png")});
    films_.clear();
    for (std::size_t h = 0; h < begins.size(); ++h) {
      std::string commands;
      for (int k = 0; k < kFrames; ++k) {
        commands += fmt::format("{:.5f} v360 yaw {:.5f};\n", std::max(0.0, k / 30.0 - 0.005),
                                yaw(k / 30.0 + begins[h]) + 10.0 * double(h));
      }
      const std::string list = write("yaw", commands);
      films_.push_back(path(name_of(h) + ".mp4"));
      ffmpeg({"-loop", "1", "-framerate", "30", "-i", path("e.png"), "-frames:v", std::to_string(kFrames), "-vf",
              "sendcmd=f=" + list +
                  ",v360=e:fisheye:w=160:h=160:h_fov=130:v_fov=130:reset_rot=1,format=yuv420p,"
                  "noise=alls=6:allf=t",
              "-c:v", "libx264", "-preset", "ultrafast", "-crf", "18", films_.back()});
    }
    heard_ = true;
  }
  static constexpr int kFrames = 420;
};

TEST_F(FilmsInMotion, WithoutSound_TheirTimesAreSeenInHowFastTheyTurn) {
  const std::vector<double> begins{1.0, 0.65, 1.413, 1.0, 0.507, 1.1};
  write_turning(begins);
  const Finished run = nodal(stitch("seen.mp4", {"--width", "128", "--seams", "fixed", "--plan"}));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("by rotation"), std::string::npos) << run.err;
  for (std::size_t h = 1; h < begins.size(); ++h) EXPECT_NEAR(said(run.err, h), 1.0 - begins[h], 2e-3) << run.err;
}

TEST_F(FilmsInMotion, StillRigWithoutSound_IsRefusedWithWhatToDo) {
  write_films(250, ".mp4", kH264);
  heard_ = true;
  expect_no_film(stitch("still.mp4", {"--width", "128"}), "the rig is still", "still.mp4");
  expect_no_film(stitch("still.mp4", {"--width", "128", "--times", "rotation"}), "or --times begin", "still.mp4");
  expect_no_film(stitch("still.mp4", {"--times", "sound"}), "its time is not known", "still.mp4");
  expect_no_film(stitch("still.mp4", {"--times", "ear"}), "some of sound,gyro,rotation,flash", "still.mp4");
}

TEST_F(FilmsInMotion, FlashesAndAReadout_TimesToAFractionOfAFrame) {
  // Frames of a rolling shutter of 20 ms, exposed for 30 ms; a flash lights the rows that are being exposed.
  const std::vector<double> begins{1.0, 0.6503, 1.4132, 1.0, 0.2071, 1.1};
  const std::vector<double> flashes{2.113, 3.871, 4.406, 6.952, 8.033, 9.671, 10.204};
  films_.clear();
  for (std::size_t h = 0; h < begins.size(); ++h) {
    std::string raw;
    for (int k = 0; k < 330; ++k) {
      std::vector<std::uint8_t> bytes = town().bytes[h];
      for (int y = 0; y < kSide; ++y) {
        const double exposed = begins[h] + k / 30.0 + 0.02 * y / (kSide - 1);
        const bool lit = std::ranges::any_of(flashes, [&](double at) { return at >= exposed && at < exposed + 0.03; });
        for (int x = 0; x < 3 * kSide; ++x) {
          std::uint8_t& level = bytes[static_cast<std::size_t>(3 * kSide * y + x)];
          level = static_cast<std::uint8_t>(level / 2 + (lit ? 100 : 0));
        }
      }
      raw.append(bytes.begin(), bytes.end());
    }
    films_.push_back(path(name_of(h) + ".mp4"));
    ffmpeg({"-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", "160x160", "-framerate", "30", "-i",
            write("raw", raw), "-pix_fmt", "yuv420p", "-c:v", "libx264", "-preset", "ultrafast", "-crf", "15",
            films_.back()});
  }
  heard_ = true;
  const Words how{"--width", "128", "--seams", "fixed", "--plan", "--times", "flash"};
  Words known = how;
  known.insert(known.end(), {"--readout", "20"});
  const Finished run = nodal(stitch("flash.mp4", known));
  ASSERT_EQ(run.code, 0) << run.err;
  for (std::size_t h = 1; h < begins.size(); ++h) EXPECT_NEAR(said(run.err, h), 1.0 - begins[h], 1e-3) << run.err;
}

/// A clip by GoPro and a part of it, as films of two cameras.
class GoProFilms : public FilmsWithSound {
 protected:
  void SetUp() override {
    FilmsWithSound::SetUp();
    const std::string clip = NODAL_SHARED_DIR "/data/gpmf/karma.mp4";
    if (IsSkipped()) return;
    if (!std::filesystem::exists(clip)) GTEST_SKIP() << "test data not there: ../shared/data/gpmf";
    write("part.txt", "");
    ffmpeg({"-ss", "2.002", "-i", clip, "-map", "0:v", "-map", "0:a", "-map", "0:3", "-c", "copy", "-copy_unknown",
            "-tag:d", "gpmd", path("part.mov")});
    Calibration rig = test::six_fisheyes(480, 120);
    rig.heads.resize(2);
    for (HeadCalibration& head : rig.heads) {
      head.width = 854;
      head.center_x = 427;
      head.region = {0, 0, 854, 480, {}};
    }
    write("rig.json", to_json(rig));
    films_ = {clip, path("part.mov")};
    heard_ = true;
  }
};

TEST_F(GoProFilms, ClipAndAPartOfIt_SoundAndGyroBothSayWhereItBegins) {
  // The key frame at 2.002 s is the part's first frame.
  const Words how{"--width", "128", "--seams", "fixed", "--plan"};
  const auto with = [&](const std::string& source) {
    Words words = how;
    words.insert(words.end(), {"--times", source});
    return nodal(stitch(source + ".mp4", words));
  };
  const Finished sound = with("sound"), gyro = with("gyro"), both = with("sound,gyro");
  EXPECT_NEAR(said(sound.err, 1), -2.002, 1e-4) << sound.err;
  EXPECT_NEAR(said(gyro.err, 1), -2.002, 3e-3) << gyro.err;
  EXPECT_NEAR(said(both.err, 1), -2.002, 1e-3) << both.err;
  EXPECT_NE(both.err.find("by sound and rotation"), std::string::npos) << both.err;
}

}  // namespace
}  // namespace nodal::command_line
