// Films as cameras and programs write them: variable rates, edit lists, rotation tags, several tracks, damage.
#include <sys/mount.h>
#include <unistd.h>

#include <cmath>

#include "film_command.h"

namespace nodal::command_line {
namespace {

class FilmInput : public FilmCommand {
 protected:
  const Words kHow{"--codec", "ffv1", "--seams", "fixed", "--width", "128"};
  std::string stitched(const std::string& out) {
    expect_good(stitch(out, kHow));
    return pixels(path(out), "rgb24");
  }
  static constexpr std::size_t kFrameBytes = 128 * 64 * 3;
};

TEST_F(FilmInput, SameFilmTwice_IsRefusedWithBothNames) {
  write_films(4, ".mkv", kLossless);
  std::filesystem::copy_file(films_[1], path("copy.mkv"));
  films_[4] = path("copy.mkv");
  expect_no_film(stitch("s.mkv", kHow), "copy.mkv: it is the same film as " + films_[1], "s.mkv");
}

TEST_F(FilmInput, AllHeadsAsTracksOfOneFile_TheSameBytes) {
  write_films(4, ".mkv", kLossless);
  const std::string apart = stitched("apart.mkv");
  Words words;
  for (const std::string& film : films_) words.insert(words.end(), {"-i", film});
  for (std::size_t h = 0; h < films_.size(); ++h) words.insert(words.end(), {"-map", std::to_string(h) + ":v"});
  words.insert(words.end(), {"-c", "copy", path("one.mkv")});
  ffmpeg(words);
  const Words separate = films_;
  films_ = {path("one.mkv")};
  EXPECT_TRUE(stitched("one_s.mkv") == apart);
  films_ = separate;
  films_[2] = path("one.mkv");
  expect_no_film(stitch("s.mkv", kHow), "one.mkv: it has 6 tracks of pictures; give it alone", "s.mkv");
  films_ = {separate[0]};
  expect_no_film(stitch("s.mkv", kHow), "it has 1 track of pictures, and head 2 wants another one", "s.mkv");
}

TEST_F(FilmInput, AllHeadsSideBySideInOneFilm_TheSameBytes) {
  write_films(4, ".mkv", kLossless);
  const std::string apart = stitched("apart.mkv");
  Words words;
  for (const std::string& film : films_) words.insert(words.end(), {"-i", film});
  words.insert(words.end(), {"-filter_complex", "[0][1][2]hstack=3[a];[3][4][5]hstack=3[b];[a][b]vstack", "-c:v",
                             "ffv1", "-pix_fmt", "gbrp", path("beside.mkv")});
  ffmpeg(words);
  films_ = {path("beside.mkv")};
  EXPECT_TRUE(stitched("beside_s.mkv") == apart);
}

TEST_F(FilmInput, RotationTag_PicturesAreTakenAsTheyAreCoded) {
  write_films(4, ".mp4", kH264);
  const std::string plain = stitched("plain.mkv");
  ffmpeg({"-i", films_[1], "-c", "copy", "-metadata:s:v", "rotate=90", path("turned.mp4")});
  films_[1] = path("turned.mp4");
  const Finished run = nodal(stitch("turned.mkv", kHow));
  EXPECT_NE(run.err.find("turned.mp4: it has a rotation tag of"), std::string::npos) << run.err;
  EXPECT_TRUE(pixels(path("turned.mkv"), "rgb24") == plain);
}

TEST_F(FilmInput, EditListThatLeavesFramesOut_TheFilmBeginsWhereThePlayerBegins) {
  // Key frames are 20 frames apart: a copy from frame 25 on holds frames 20 to 24 as well, and an edit list.
  write_films(40, ".mp4", kH264);
  const std::string whole = stitched("whole.mkv");
  for (std::string& film : films_) {
    const std::string cut = film + ".cut.mp4";
    ffmpeg({"-ss", "0.8333334", "-i", film, "-c", "copy", cut});
    film = cut;
  }
  const std::string cut = stitched("cut.mkv");
  ASSERT_EQ(cut.size() % kFrameBytes, 0u);
  EXPECT_EQ(cut.size() / kFrameBytes, 15u);
  EXPECT_TRUE(whole.ends_with(cut));
}

TEST_F(FilmInput, VariableRate_EachInstantHasTheNearestFrame) {
  write_films(14, ".mkv", kLossless);
  const std::string full = films_[2], variable = path("variable.mkv");
  ffmpeg({"-i", full, "-vf", "select='not(between(n,5,8))'", "-fps_mode", "vfr", "-c:v", "ffv1", variable});
  films_[2] = variable;
  const std::string from_variable = stitched("variable_s.mkv");
  // Frames 5 and 6 are nearest to 4, 7 and 8 to 9.
  std::string raw;
  for (const int f : {0, 1, 2, 3, 4, 4, 4, 9, 9, 9, 10, 11, 12, 13}) {
    const auto bytes = picture(2, f);
    raw.append(bytes.begin(), bytes.end());
  }
  films_[2] = path("repeated.mkv");
  ffmpeg({"-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", "160x160", "-framerate", "30", "-i", write("raw", raw),
          "-c:v", "ffv1", films_[2]});
  EXPECT_TRUE(stitched("repeated_s.mkv") == from_variable);
}

TEST_F(FilmInput, HdrLight_IsRefusedWithWhatToDo) {
  write_films(4, ".mp4", kH264);
  for (const char* const transfer : {"arib-std-b67", "smpte2084"}) {
    ffmpeg({"-i", films_[0], "-vf", "format=yuv420p10le", "-color_trc", transfer, "-c:v", "ffv1", path("hdr.mkv")});
    Words films = films_;
    films_[3] = path("hdr.mkv");
    expect_no_film(stitch("s.mkv", kHow), "which is not supported yet; convert it to SDR", "s.mkv");
    films_ = films;
  }
}

TEST_F(FilmInput, PartThatCannotBeDecoded_TheFrameBeforeIsShownAndANoteSaysSo) {
  write_films(60, ".mp4", kH264);
  std::string bytes = read(std::filesystem::path(films_[1]).filename().string());
  const std::size_t media = bytes.find("mdat");
  ASSERT_NE(media, std::string::npos);
  for (std::size_t k = bytes.size() * 2 / 5; k < bytes.size() * 3 / 5; ++k) {
    if (k > media + 100) bytes[k] = static_cast<char>(k * 131 >> 3);
  }
  films_[1] = write("hurt.mp4", bytes);
  const Finished run = nodal(stitch("s.mp4", {"--width", "128", "--preset", "ultrafast"}));
  if (run.code == 0) {
    EXPECT_NE(ffprobe("stream=nb_frames", path("s.mp4")).find("nb_frames=60"), std::string::npos);
    EXPECT_NE(run.err.find("hurt.mp4"), std::string::npos) << run.err;
  } else {
    EXPECT_NE(run.err.find("hurt.mp4: it cannot be decoded"), std::string::npos) << run.err;
    EXPECT_FALSE(std::filesystem::exists(path("s.mp4")));
  }
}

TEST_F(FilmInput, FilmThatChangesBetweenShards_IsRefused) {
  write_films(250, ".mp4", kH264);
  const Words how{"--width", "128", "--preset", "ultrafast"};
  Words first = how, second = how;
  first.insert(first.end(), {"--segments", "0"});
  second.insert(second.end(), {"--segments", "1"});
  expect_good(stitch("s.mp4", first));
  std::filesystem::copy_file(films_[0], path("other.mp4"));
  ffmpeg({"-i", path("other.mp4"), "-t", "8.1", "-c", "copy", films_[0]});
  expect_no_film(stitch("s.mp4", second), "other settings (films)", "s.mp4");
}

TEST_F(FilmInput, TwoWritersOfOneSegment_TheSameFilm) {
  write_films(250, ".mp4", kH264);
  const Words how{"--width", "128", "--preset", "ultrafast", "--seams", "fixed"};
  expect_good(stitch("one.mp4", how));
  Words all = how;
  all.insert(all.end(), {"--segments", "0-1"});
  const auto first = start(stitch("two.mp4", all)), second = start(stitch("two.mp4", all));
  const Finished a = first->wait(), b = second->wait();
  EXPECT_EQ(a.code, 0) << a.err;
  EXPECT_EQ(b.code, 0) << b.err;
  Words join = how;
  join.emplace_back("--join");
  expect_good(stitch("two.mp4", join));
  EXPECT_TRUE(read("two.mp4") == read("one.mp4"));
}

TEST_F(FilmInput, WhatKilledRunsLeft_IsRemovedAndNothingElseIs) {
  write_films(4, ".mp4", kH264);
  std::array<char, 65> host{};
  ::gethostname(host.data(), host.size() - 1);
  const auto gone = start({"--version"});
  const std::string pid = std::to_string(gone->pid());
  gone->wait();
  const std::string mark = std::string(".part-") + host.data() + "-";
  const std::string dead = write("s.mp4" + mark + pid + ".joined", "x"), other = write("s.mp4.part-elsewhere-1", "x");
  const std::string alive = write("s.mp4" + mark + std::to_string(::getpid()), "x"), mine = write("s.mp4.part-1", "x");
  expect_good(stitch("s.mp4", {"--width", "128"}));
  EXPECT_FALSE(std::filesystem::exists(dead));
  for (const std::string& kept : {other, alive, mine}) EXPECT_TRUE(std::filesystem::exists(kept)) << kept;
}

TEST_F(FilmInput, DecoderThatWantsAllMemory_IsStoppedByItsLimit) {
  write_films(4, ".mp4", kH264);
  std::filesystem::create_directories(path("bin"));
  // Address space of 64 GB, without memory behind it: only the limit refuses it.
  write("bin/ffmpeg",
        "#!/bin/sh\ncase \"$*\" in *pipe:1*)\n"
        "  python3 -c 'from mmap import *; mmap(-1, 64 << 30, MAP_PRIVATE | MAP_ANONYMOUS, PROT_READ)' 2>/dev/null || "
        "{ echo no memory >&2; exit 9; };;\nesac\n"
        "exec /usr/bin/ffmpeg \"$@\"\n");
  std::filesystem::permissions(path("bin/ffmpeg"), std::filesystem::perms::all);
  environment_["NODAL_CONFINE"] = "off";  // the stand-in is a script
  environment_["PATH"] = path("bin") + ":" + std::getenv("PATH");
  expect_no_film(stitch("s.mp4", {"--width", "128", "--seams", "fixed"}),
                 "it cannot be decoded: ffmpeg failed: no memory", "s.mp4");
}

TEST_F(FilmInput, DiskThatCannotBeWritten_OneSentence) {
  write_films(4, ".mp4", kH264);
  std::filesystem::create_directories(path("disk"));
  if (::geteuid() != 0 || ::mount("tmpfs", path("disk").c_str(), "tmpfs", MS_RDONLY, "size=10m") != 0) {
    GTEST_SKIP() << "only root mounts a disk";
  }
  expect_no_film(stitch("disk/s.mp4", {"--width", "128"}), "Read-only file system", "disk/s.mp4");
  ::umount(path("disk").c_str());
}

TEST_F(FilmInput, DiskThatIsFullWhenTheFilmIsJoined_GoesOnWithRoom) {
  write_films(60, ".mp4", kH264);
  const Words how{"--width", "512", "--codec", "ffv1", "--seams", "fixed"};
  expect_good(stitch("big.mkv", how));
  const auto bytes = std::filesystem::file_size(path("big.mkv"));
  std::filesystem::create_directories(path("small"));
  const std::string size = "size=" + std::to_string(bytes * 3 / 2);  // the segments, and half of the film
  if (::geteuid() != 0 || ::mount("tmpfs", path("small").c_str(), "tmpfs", 0, size.c_str()) != 0) {
    GTEST_SKIP() << "only root mounts a small disk";
  }
  expect_no_film(stitch("small/big.mkv", how), "the disk is full", "small/big.mkv");
  for (const auto& entry : std::filesystem::directory_iterator(path("small"))) {
    EXPECT_EQ(entry.path().filename(), "big.mkv.parts");
  }
  EXPECT_EQ(::mount("tmpfs", path("small").c_str(), "tmpfs", MS_REMOUNT, "size=100m"), 0);
  expect_good(stitch("small/big.mkv", how));
  EXPECT_TRUE(read("small/big.mkv") == read("big.mkv"));
  ::umount(path("small").c_str());
}

}  // namespace
}  // namespace nodal::command_line
