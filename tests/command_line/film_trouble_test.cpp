// `nodal stitch` with films that it cannot use: one sentence, and nothing under the final name.
#include <sys/mount.h>
#include <unistd.h>

#include <csignal>

#include "film_command.h"

namespace nodal::command_line {
namespace {

using FilmTrouble = FilmCommand;

TEST_F(FilmTrouble, Inputs_OneSentenceEach) {
  write_films(6, ".mp4", kH264);
  const Words good = films_;
  const auto with = [&](const std::string& film) {
    films_ = good;
    films_[2] = film;
    return stitch("s.mp4", {"--width", "128"});
  };
  const std::string whole = read(name_of(2) + ".mp4");
  expect_no_film(with(write("nomoov.mp4", whole.substr(0, whole.find("moov") - 4))), "index (moov) is missing",
                 "s.mp4");
  expect_no_film(with(path("absent.mp4")), "No such file", "s.mp4");
  expect_no_film(with(write("list.mp4", "ffconcat version 1.0\nfile " + name_of(2) + ".mp4\n")), "names other files",
                 "s.mp4");
  expect_no_film(with(write("play.mp4", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n" + name_of(2) + ".mp4\n")),
                 "names other files", "s.mp4");
  expect_no_film(with(write("noise.mp4", std::string(5000, 'x'))), "noise.mp4", "s.mp4");
  ffmpeg({"-i", good[2], "-vf", "scale=98:75", "-c:v", "ffv1", path("odd.mkv")});
  expect_no_film(with(path("odd.mkv")), "98x75 pixels, and head '" + name_of(2) + "' is calibrated for 160x160",
                 "s.mp4");
  films_ = {good[0], good[1]};
  expect_no_film(stitch("s.mp4"), "the calibration has 6 heads, and there are 2 films", "s.mp4");
  films_ = good;
  write("s.mp4", "mine");
  const Finished run = nodal(stitch("s.mp4"));
  EXPECT_NE(run.code, 0);
  EXPECT_TRUE(read("s.mp4") == "mine") << run.err;
  EXPECT_TRUE(parts("s.mp4").empty());
}

TEST_F(FilmTrouble, TruncatedFilm_IsUsedAsFarAsItGoesWithANote) {
  write_films(40, ".mp4", kH264);
  ffmpeg({"-i", films_[0], "-c", "copy", "-movflags", "+faststart", path("front.mp4")});
  const std::string whole = read("front.mp4");
  films_[0] = write("cut.mp4", whole.substr(0, whole.size() * 2 / 3));
  const Finished run = nodal(stitch("s.mp4", {"--width", "128"}));
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("cut.mp4: it is cut: it has"), std::string::npos) << run.err;
}

TEST_F(FilmTrouble, StrangeNames_AreNames) {
  write_films(4, ".mp4", kH264);
  const Words names{"a b.mp4", "100%d.mp4", "new\nline.mp4", "concat:x|y.mp4", "http:x.mp4", "'q\".mp4"};
  for (std::size_t h = 0; h < films_.size(); ++h) {
    std::filesystem::rename(films_[h], path(names[h]));
    films_[h] = path(names[h]);
  }
  expect_good(stitch("s %04x'\".mp4", {"--width", "128"}));
  EXPECT_TRUE(std::filesystem::exists(path("s %04x'\".mp4")));
}

TEST_F(FilmTrouble, PlanOfOtherSettingsOrAnotherVersion_IsRefused) {
  write_films(6, ".mp4", kH264);
  expect_good(stitch("s.mp4", {"--width", "128", "--segments", "0"}));
  expect_no_film(stitch("s.mp4", {"--width", "256"}), "other settings (width, height)", "s.mp4");
  expect_no_film(stitch("s.mp4", {"--width", "128", "--segments", "1"}), "the film has the segments 0 to 0", "s.mp4");
  std::string plan = read("s.mp4.parts/plan.json");
  plan.replace(plan.find("film plan 2"), 11, "film plan 3");
  write("s.mp4.parts/plan.json", plan);
  expect_no_film(stitch("s.mp4", {"--width", "128"}), "another version of nodal", "s.mp4");
}

TEST_F(FilmTrouble, ProgramsAbsentOldKilledOrWithoutTheEncoder_OneSentence) {
  write_films(6, ".mp4", kH264);
  const std::string path_before = std::getenv("PATH");
  environment_["NODAL_CONFINE"] = "off";  // the stand-ins are scripts
  const auto stand_in = [&](const std::string& script) {
    std::filesystem::create_directories(path("bin"));
    write("bin/ffmpeg", "#!/bin/sh\n" + script + "\nexec /usr/bin/ffmpeg \"$@\"\n");
    std::filesystem::permissions(path("bin/ffmpeg"), std::filesystem::perms::all);
    environment_["PATH"] = path("bin") + ":" + path_before;
  };
  stand_in("case $1 in -version) echo 'ffmpeg version 4.3.1'; exit;; esac");
  expect_no_film(stitch("s.mp4"), "version 4.3.1 is older than 5.1", "s.mp4");
  stand_in(
      "case $2 in -encoders) echo ' ------'; echo ' V....D ffv1                 FFmpeg video codec #1'; exit;; esac");
  expect_no_film(stitch("s.mp4"), "has no encoder libx264; install Debian's ffmpeg, or choose --codec ffv1", "s.mp4");
  EXPECT_TRUE(parts("s.mp4").empty());
  stand_in("case \"$*\" in *pipe:0*) kill -9 $$;; esac");
  expect_no_film(stitch("s.mp4", {"--width", "128"}), "was killed by signal 9", "s.mp4");
  std::filesystem::remove_all(path("s.mp4.parts"));
  stand_in("case \"$*\" in *pipe:1*) kill -9 $$;; esac");
  expect_no_film(stitch("s.mp4", {"--width", "128"}), "was killed by signal 9", "s.mp4");
  std::filesystem::remove_all(path("s.mp4.parts"));
  // 100 MB of complaints do not stop it, and are not kept.
  stand_in("case \"$*\" in *pipe:1*) head -c 100000000 /dev/zero | tr '\\0' 'e' >&2;; esac");
  expect_good(stitch("s.mp4", {"--width", "128"}));
  environment_["PATH"] = path("nothing");
  expect_no_film(stitch("t.mp4"), "which is not installed: apt install ffmpeg", "t.mp4");
}

TEST_F(FilmTrouble, FullDisk_SaysSoAndGoesOnLater) {
  write_films(60, ".mp4", kH264);
  std::filesystem::create_directories(path("small"));
  if (::geteuid() != 0 || ::mount("tmpfs", path("small").c_str(), "tmpfs", 0, "size=200k") != 0) {
    GTEST_SKIP() << "only root mounts a small disk";
  }
  const Words how{"--width", "512", "--codec", "ffv1"};
  const Finished run = nodal(stitch("small/s.mkv", how));
  EXPECT_NE(run.code, 0);
  EXPECT_NE(run.err.find("the disk is full"), std::string::npos) << run.err;
  EXPECT_FALSE(std::filesystem::exists(path("small/s.mkv")));
  for (const std::string& name : parts("small/s.mkv")) EXPECT_EQ(name.find("part-"), std::string::npos) << name;
  ::umount(path("small").c_str());
}

}  // namespace
}  // namespace nodal::command_line
