// `nodal stitch` with films: pixels, segments, time, sound, metadata.
#include <sys/wait.h>

#include <cmath>
#include <csignal>
#include <cstring>

#include "film_command.h"

namespace nodal::command_line {
namespace {

using Films = FilmCommand;

TEST_F(Films, Lossless_FramesAreTheBytesOfStitchedPictures) {
  constexpr int kFrames = 4;
  write_films(kFrames, ".mkv", kLossless);
  expect_good(stitch("s.mkv", {"--codec", "ffv1", "--seams", "fixed", "--width", "256"}));
  const std::string film = pixels(path("s.mkv"), "rgb24");
  std::string wanted;
  for (int f = 0; f < kFrames; ++f) {
    Words words{"stitch", path("rig.json")};
    for (std::size_t h = 0; h < town().bytes.size(); ++h) {
      words.push_back(path(name_of(h) + ".png"));
      test::write_bytes(words.back(), test::png_of(picture(h, f), kSide, kSide, 3));
    }
    const std::string out = path("s" + std::to_string(f) + ".raw");
    words.insert(words.end(), {"--blend", "board", "--width", "256", "--crop", "none", "-o", out});
    expect_good(words);
    wanted += read("s" + std::to_string(f) + ".raw");
  }
  ASSERT_EQ(film.size(), 256u * 128 * 3 * kFrames);
  EXPECT_TRUE(film == wanted);
}

TEST_F(Films, OneProcessShardsKillsAndATruncatedSegment_SameBytes) {
  write_films(500, ".mp4", kH264);
  const Words how{"--width", "128", "--preset", "ultrafast"};
  const auto with = [&](const Words& more) {
    Words words = how;
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  expect_good(stitch("one.mp4", how));
  const std::string one = read("one.mp4");
  ASSERT_GT(one.size(), 10'000u);
  EXPECT_TRUE(parts("one.mp4").empty());

  for (const char* const shard : {"2", "0", "1"}) expect_good(stitch("three.mp4", with({"--segments", shard})));
  expect_good(stitch("three.mp4", with({"--join"})));
  EXPECT_TRUE(read("three.mp4") == one) << "three shards";

  expect_good(stitch("cut.mp4", with({"--segments", "0-1"})));
  expect_no_film(stitch("cut.mp4", with({"--join"})), "segments are missing or damaged: 2", "cut.mp4");
  for (const std::string& name : parts("cut.mp4")) {
    if (name.starts_with("seg-00001") && name.ends_with(".mp4")) {
      std::filesystem::resize_file(path("cut.mp4.parts/" + name), 1000);
    }
  }
  expect_no_film(stitch("cut.mp4", with({"--join"})), "segments are missing or damaged: 1-2", "cut.mp4");
  expect_good(stitch("cut.mp4", how));
  EXPECT_TRUE(read("cut.mp4") == one) << "a truncated segment";

  // Killed whenever another file has appeared in the folder, until a run is not.
  std::size_t seen = 0;
  for (int kills = 0; kills < 40 && !std::filesystem::exists(path("kill.mp4")); ++kills) {
    const auto run = start(stitch("kill.mp4", how));
    const auto more = [&] { return parts("kill.mp4").size() > seen || ::kill(run->pid(), 0) != 0; };
    test::wait_until([&] { return more() || std::filesystem::exists(path("kill.mp4")); });
    seen = parts("kill.mp4").size();
    run->signal(SIGKILL);
    run->wait();
  }
  if (!std::filesystem::exists(path("kill.mp4"))) expect_good(stitch("kill.mp4", how));
  EXPECT_TRUE(read("kill.mp4") == one) << "killed and started again";

  // Ctrl-C leaves whole segments.
  const auto run = start(stitch("stop.mp4", how));
  EXPECT_TRUE(test::wait_until([&] { return parts("stop.mp4").size() > 2; }));
  run->signal(SIGINT);
  const Finished stopped = run->wait();
  EXPECT_NE(stopped.code, 0);
  EXPECT_NE(stopped.err.find("goes on from there"), std::string::npos) << stopped.err;
  expect_good(stitch("stop.mp4", how));
  EXPECT_TRUE(read("stop.mp4") == one) << "stopped";

  // Times are evenly spaced across the joints.
  std::vector<long> times;
  std::istringstream lines(ffprobe("packet=pts", path("one.mp4")));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("pts=")) times.push_back(std::stol(line.substr(4)));
  }
  std::ranges::sort(times);
  ASSERT_EQ(times.size(), 500u);
  for (std::size_t k = 0; k < times.size(); ++k) EXPECT_EQ(times[k], 512 * static_cast<long>(k)) << k;
}

TEST_F(Films, Preview_IsOneFrameInNAtItsTime) {
  const Words how{"--codec", "ffv1", "--seams", "fixed", "--width", "128"};
  Words small = how;
  small.emplace_back("--preview");
  for (const char* const rate : {"30", "1"}) {  // decoders go on to the next frame, or seek to it
    write_films(100, ".mp4", kH264, rate);
    const std::string name = std::string("s") + rate;
    expect_good(stitch(name + ".mkv", how));
    expect_good(stitch(name + "p.mkv", small));
    constexpr std::size_t kFrame = 128 * 64 * 3 / 2;
    const std::string all = pixels(path(name + ".mkv"), "yuv420p"), few = pixels(path(name + "p.mkv"), "yuv420p");
    ASSERT_EQ(all.size(), 100 * kFrame);
    ASSERT_EQ(few.size(), 34 * kFrame) << "100 frames are one in 3";
    for (std::size_t k = 0; k < 34; ++k) {
      EXPECT_TRUE(few.substr(k * kFrame, kFrame) == all.substr(3 * k * kFrame, kFrame)) << rate << ": frame " << k;
    }
    EXPECT_NE(ffprobe("stream=avg_frame_rate", path(name + "p.mkv")).find(std::string(rate) == "30" ? "=10/1" : "=1/3"),
              std::string::npos);
  }
  EXPECT_EQ(nodal_json(stitch("p.mp4", {"--preview"})).back()["frames"], 34);
}

TEST_F(Films, OffsetAndClock_TheFramesOfOneInstantAreShownTogether) {
  write_films(20, ".mkv", kLossless);
  const Words how{"--codec", "ffv1", "--seams", "fixed", "--width", "128"};
  expect_good(stitch("even.mkv", how));
  const std::string even = pixels(path("even.mkv"), "rgb24");
  // Head 2 began to film 4 frames earlier than the others: what they show first is at 4/30 s in its film.
  std::string raw;
  for (int f = -4; f < 20; ++f) {
    const auto bytes = picture(2, (f + 40) % 40);
    raw.append(bytes.begin(), bytes.end());
  }
  write("raw", raw);
  ffmpeg({"-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", "160x160", "-framerate", "30", "-i", path("raw"),
          "-c:v", "ffv1", films_[2]});
  Words shifted = how;
  shifted.insert(shifted.end(), {"--offset", name_of(2) + "=0.1333"});
  expect_good(stitch("shifted.mkv", shifted));
  EXPECT_TRUE(pixels(path("shifted.mkv"), "rgb24") == even);
  // Without the offset it is another film.
  expect_good(stitch("wrong.mkv", how));
  EXPECT_FALSE(pixels(path("wrong.mkv"), "rgb24") == even);
  expect_no_film(stitch("no.mkv", {"--offset", "nobody=1"}), "no head of this name", "no.mkv");
  expect_no_film(stitch("no.mkv", {"--offset", name_of(2) + "=100"}), "no time in common", "no.mkv");
}

TEST_F(Films, FilmThatEndsEarly_TheResultEndsThereAndANoteNamesTheHead) {
  write_films(20, ".mp4", kH264);
  ffmpeg({"-i", films_[3], "-frames:v", "12", "-c:v", "libx264", path("short.mp4")});
  films_[3] = path("short.mp4");
  const Finished run = nodal(stitch("s.mp4", {"--width", "128"}));
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("because " + path("short.mp4") + " ends there"), std::string::npos) << run.err;
  EXPECT_NE(ffprobe("stream=nb_frames", path("s.mp4")).find("nb_frames=12"), std::string::npos);
}

TEST_F(Films, HeadsOfOtherRates_NearestFramesAndANote) {
  write_films(30, ".mp4", kH264);
  ffmpeg({"-i", films_[1], "-vf", "fps=25", "-c:v", "libx264", path("slow.mp4")});
  films_[1] = path("slow.mp4");
  const Finished run = nodal(stitch("s.mp4", {"--width", "128"}));
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("slow.mp4: it has 25.000 frames a second, and the result has 30.000"), std::string::npos)
      << run.err;
}

TEST_F(Films, Sound_IsThatOfTheHeadAndMovesWithIt) {
  write_films(60, ".mp4", kH264);
  // Silence, and a tone from 1 s on, in a film that began 0.4 s earlier than the others.
  ffmpeg({"-i", films_[1], "-f", "lavfi", "-i", "sine=frequency=440:duration=1.5", "-filter_complex",
          "[0:v]tpad=start_duration=0.4[v];[1:a]adelay=1000:all=1[a]", "-map", "[v]", "-map", "[a]", "-r", "30", "-c:v",
          "libx264", "-c:a", "aac", path("tone.mp4")});
  films_[1] = path("tone.mp4");
  const Words offset{"--width", "128", "--offset", name_of(1) + "=0.4"};
  const auto tone_from = [&](const std::string& film) {
    ffmpeg({"-i", path(film), "-map", "0:a:0", "-ac", "1", "-ar", "48000", "-f", "s16le", path("pcm")});
    const std::string pcm = read("pcm");
    for (std::size_t k = 0; 2 * k + 1 < pcm.size(); ++k) {
      std::int16_t value = 0;
      std::memcpy(&value, pcm.data() + 2 * k, 2);
      if (std::abs(value) > 1500) return static_cast<double>(k) / 48000;
    }
    return -1.0;
  };
  expect_good(stitch("auto.mp4", offset));
  EXPECT_NEAR(tone_from("auto.mp4"), 0.6, 0.03);  // an AAC packet has 21 ms
  expect_good(stitch("auto.mkv", offset));
  EXPECT_NEAR(tone_from("auto.mkv"), 0.6, 0.03);
  Words file = offset;
  file.insert(file.end(), {"--sound", path("tone.mp4")});
  expect_good(stitch("file.mov", file));
  EXPECT_NEAR(tone_from("file.mov"), 1.0, 0.03);  // a file begins with the rig's time
  Words none = offset;
  none.insert(none.end(), {"--sound", "none"});
  expect_good(stitch("none.mp4", none));
  EXPECT_EQ(ffprobe("stream=codec_type", path("none.mp4")).find("audio"), std::string::npos);
  expect_no_film(stitch("no.mp4", {"--sound", name_of(0)}), "has no sound", "no.mp4");
  expect_no_film(stitch("no.mp4", {"--sound", "nothing"}), "no head and no file of this name", "no.mp4");
}

/// Puts SA3D into the sound's sample entry of a file whose index is at its end: the boxes around it grow.
std::string with_sa3d(std::string file, const std::string& content) {
  const auto word = [](std::size_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<char>(value >> shift & 0xff));
    return bytes;
  };
  const auto size_at = [&](std::size_t at) {
    std::size_t size = 0;
    for (std::size_t k = 0; k < 4; ++k) size = size << 8 | static_cast<std::uint8_t>(file[at + k]);
    return size;
  };
  const std::string sa3d = word(content.size() + 8) + "SA3D" + content;
  std::size_t at = file.rfind("mp4a");
  const std::size_t end = at - 4 + size_at(at - 4);
  for (const char* const type : {"mp4a", "stsd", "stbl", "minf", "mdia", "trak", "moov"}) {
    at = file.rfind(type, at);
    file.replace(at - 4, 4, word(size_at(at - 4) + sa3d.size()));
  }
  return file.insert(end, sa3d);
}

TEST_F(Films, AmbisonicSound_KeepsItsDescriptionOrANoteSaysThatItIsLost) {
  write_films(30, ".mp4", kH264);
  ffmpeg({"-f", "lavfi", "-i", "sine=frequency=440:duration=1", "-af", "pan=4.0|c0=c0|c1=0.5*c0|c2=0.2*c0|c3=0.1*c0",
          "-c:a", "aac", path("four.mp4")});
  const std::string content("\0\0\0\0\0\1\0\0\0\0\0\4\0\0\0\0\0\0\0\1\0\0\0\2\0\0\0\3", 28);
  write("sound.mp4", with_sa3d(read("four.mp4"), content));
  const Words how{"--width", "128", "--sound", path("sound.mp4")};
  expect_good(stitch("s.mp4", how));
  const std::string film = read("s.mp4");
  const std::size_t at = film.find("SA3D" + content);
  ASSERT_NE(at, std::string::npos);
  EXPECT_GT(at, film.find("soun"));
  EXPECT_NE(ffprobe("stream=codec_name,channels", path("s.mp4")).find("codec_name=aac\nchannels=4"), std::string::npos);
  ffmpeg({"-xerror", "-i", path("s.mp4"), "-f", "null", "-"});
  const Finished matroska = nodal(stitch("s.mkv", how));
  EXPECT_EQ(matroska.code, 0) << matroska.err;
  EXPECT_NE(matroska.err.find("its sound is ambisonic; Matroska has no place to say so"), std::string::npos);
}

TEST_F(Films, EveryContainerAndCodec_SaysThatItIsASphere) {
  write_films(6, ".mp4", kH264);
  for (const auto& [out, codec, name] :
       {std::tuple{"a.mp4", "h264", "h264"}, std::tuple{"b.mp4", "h265", "hevc"},
        std::tuple{"c.mov", "prores", "prores"}, std::tuple{"d.mkv", "ffv1", "ffv1"},
        std::tuple{"e.mp4", "mpeg2", "mpeg2video"}, std::tuple{"f.mkv", "h264", "h264"}}) {
    expect_good(stitch(out, {"--width", "128", "--codec", codec}));
    const std::string streams =
        Process({"ffprobe", "-v", "error", "-show_streams", "-count_frames", path(out)}).wait().out;
    EXPECT_NE(streams.find(std::string("codec_name=") + name), std::string::npos) << streams;
    EXPECT_NE(streams.find("projection=equirectangular"), std::string::npos) << out << "\n" << streams;
    EXPECT_NE(streams.find("nb_read_frames=6"), std::string::npos) << out << "\n" << streams;
    const bool converted = std::string(codec) == "prores" || std::string(codec) == "mpeg2";
    EXPECT_NE(streams.find(converted ? "color_range=tv" : "color_range=pc"), std::string::npos) << out << "\n"
                                                                                                << streams;
  }
  const std::string mp4 = read("a.mp4");
  EXPECT_LT(mp4.find("moov"), mp4.find("mdat"));
  const Finished exiftool = Process({"exiftool", "-G1", "-s", path("a.mp4")}).wait();
  if (exiftool.code == 127 || exiftool.out.empty()) GTEST_SKIP() << "exiftool is not installed";
  EXPECT_NE(exiftool.out.find("XMP-GSpherical"), std::string::npos) << exiftool.out;
  EXPECT_NE(exiftool.out.find("ProjectionBoundsTop"), std::string::npos) << exiftool.out;
}

TEST_F(Films, LimitedAndFullRange_BothAreShownAsTheyAre) {
  write_films(3, "_full.mp4",
              {"-vf", "scale=out_range=pc:out_color_matrix=bt601,format=yuvj420p", "-c:v", "libx264", "-crf", "1"});
  expect_good(stitch("full.mkv", {"--codec", "ffv1", "--seams", "fixed", "--width", "128"}));
  const std::string full = pixels(path("full.mkv"), "yuv420p");
  write_films(3, "_tv.mp4",
              {"-vf", "scale=out_range=tv:out_color_matrix=bt709,format=yuv420p", "-color_range", "tv", "-colorspace",
               "bt709", "-c:v", "libx264", "-crf", "1"});
  expect_good(stitch("tv.mkv", {"--codec", "ffv1", "--seams", "fixed", "--width", "128"}));
  const std::string tv = pixels(path("tv.mkv"), "yuv420p");
  ASSERT_EQ(full.size(), tv.size());
  double sum = 0;
  const std::size_t luma = 128 * 64;
  for (std::size_t k = 0; k < luma; ++k) {
    sum += std::abs(static_cast<std::uint8_t>(full[k]) - static_cast<std::uint8_t>(tv[k]));
  }
  EXPECT_LT(sum / static_cast<double>(luma), 1.0);
}

TEST_F(Films, AFolderOfPartsThatHoldsSomethingElse_KeepsIt) {
  write_films(4, ".mkv", kLossless);
  std::filesystem::create_directories(path("s.mkv.parts/seg-notes"));
  write("s.mkv.parts/notes.txt", "mine");
  write("s.mkv.parts/seg-notes.txt", "mine");
  expect_good(stitch("s.mkv", {"--codec", "ffv1", "--seams", "fixed", "--width", "128"}));
  EXPECT_EQ(read("s.mkv.parts/notes.txt"), "mine");
  EXPECT_EQ(parts("s.mkv"), (std::vector<std::string>{"notes.txt", "seg-notes", "seg-notes.txt"}));
}

}  // namespace
}  // namespace nodal::command_line
