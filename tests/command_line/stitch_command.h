// A rendered rig of six heads in a town, as files for `nodal stitch`.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "rig_process.h"
#include "tests/support/pictures.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {

inline constexpr int kSide = 160;

class StitchCommand : public RigTest {
 protected:
  static const test::RenderedRig& town() {
    static const test::RenderedRig rig =
        test::render_rig(test::six_fisheyes(kSide), hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1.0, 5, 3});
    return rig;
  }
  /// Writes rig.json, and the pictures of the town in `folder`.
  void write_pictures(const std::string& folder) {
    write("rig.json", to_json(town().truth));
    std::filesystem::create_directories(path(folder));
    for (std::size_t h = 0; h < town().bytes.size(); ++h) {
      test::write_bytes(path(folder + "/" + name_of(h) + ".png"), test::png_of(town().bytes[h], kSide, kSide, 3));
    }
  }
  static std::string name_of(std::size_t head) { return town().truth.heads[head].name; }
  void expect_refused(const Words& words, const std::string& says) const {
    Words all{"stitch"};
    all.insert(all.end(), words.begin(), words.end());
    const Finished run = nodal(all);
    EXPECT_NE(run.code, 0) << says;
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
    EXPECT_EQ(run.err.find("unexpected"), std::string::npos) << run.err;
  }
};

}  // namespace nodal::command_line
