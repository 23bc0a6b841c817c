// Films of a rendered rig of six heads, made by ffmpeg, for `nodal stitch`.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "stitch_command.h"

namespace nodal::command_line {

class FilmCommand : public StitchCommand {
 protected:
  void SetUp() override {
    if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
    write("rig.json", to_json(town().truth));
    environment_["NODAL_OVERWRITE"] = "0";
  }

  /// Runs ffmpeg; it must succeed.
  void ffmpeg(Words words) const {
    Words all{"ffmpeg", "-hide_banner", "-v", "error", "-nostdin", "-y"};
    all.insert(all.end(), words.begin(), words.end());
    const Finished run = Process(all).wait();
    ASSERT_EQ(run.code, 0) << run.err;
  }
  std::string ffprobe(const std::string& what, const std::string& file) const {
    return Process({"ffprobe", "-v", "error", "-show_entries", what, "-of", "default=nw=1", file}).wait().out;
  }
  /// Decoded pictures of a film, one after the other.
  std::string pixels(const std::string& file, const std::string& format) const {
    ffmpeg({"-i", file, "-map", "0:v:0", "-fps_mode", "passthrough", "-pix_fmt", format, "-f", "rawvideo",
            path("pixels")});
    return read("pixels");
  }

  /// The picture of a head in a frame: the town, with a level that is different in every frame.
  static std::vector<std::uint8_t> picture(std::size_t head, int frame) {
    std::vector<std::uint8_t> bytes = town().bytes[head];
    for (std::uint8_t& level : bytes) level = static_cast<std::uint8_t>(level / 2 + 3 * (frame % 40));
    return bytes;
  }
  /// Lossless films of these frames, under `names`; more words of ffmpeg's.
  void write_films(int frames, const std::string& ending, const Words& more, const std::string& rate = "30") {
    films_.clear();
    for (std::size_t h = 0; h < town().bytes.size(); ++h) {
      std::string raw;
      for (int f = 0; f < frames; ++f) {
        const std::vector<std::uint8_t> bytes = picture(h, f);
        raw.append(bytes.begin(), bytes.end());
      }
      write("raw", raw);
      films_.push_back(path(name_of(h) + ending));
      Words words{"-f",      "rawvideo",   "-pix_fmt", "rgb24", "-video_size",
                  "160x160", "-framerate", rate,       "-i",    path("raw")};
      words.insert(words.end(), more.begin(), more.end());
      words.push_back(films_.back());
      ffmpeg(words);
    }
  }
  /// nodal stitch rig.json FILMS WORDS -o OUT; films without sound are of one instant, unless the words say more.
  Words stitch(const std::string& out, const Words& more = {}) const {
    Words words{"stitch", path("rig.json")};
    words.insert(words.end(), films_.begin(), films_.end());
    words.insert(words.end(), more.begin(), more.end());
    if (!heard_ && std::ranges::find(more, "--times") == more.end()) words.insert(words.end(), {"--times", "begin"});
    words.insert(words.end(), {"-o", path(out)});
    return words;
  }
  void expect_good(const Words& words) const {
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
  }
  /// One sentence, and nothing under the final name.
  void expect_no_film(const Words& words, const std::string& says, const std::string& out) const {
    const Finished run = nodal(words);
    EXPECT_NE(run.code, 0) << says;
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
    EXPECT_FALSE(std::filesystem::exists(path(out))) << says;
  }
  std::vector<std::string> parts(const std::string& out) const {
    std::vector<std::string> names;
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(path(out + ".parts"), none)) {
      names.push_back(entry.path().filename().string());
    }
    std::ranges::sort(names);
    return names;
  }

  Words films_;
  bool heard_ = false;  ///< the films tell their times
};

inline const Words kLossless{"-c:v", "ffv1"};
inline const Words kH264{"-pix_fmt", "yuv420p", "-c:v", "libx264", "-preset", "ultrafast", "-g", "20"};

}  // namespace nodal::command_line
