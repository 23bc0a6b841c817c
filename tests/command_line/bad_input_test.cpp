// Pictures that do not belong together, files that are not read and disks that are full: what `nodal stitch` says.
#include <sys/mount.h>

#include <algorithm>
#include <functional>

#include "stitch_command.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;
using Rgb = std::vector<std::uint8_t>;

class BadInput : public StitchCommand {
 protected:
  /// The pictures of the town, of which `change` may change one.
  void write_town(const std::function<void(std::size_t head, Rgb& rgb)>& change = [](std::size_t, Rgb&) {}) {
    fs::create_directories(path("town"));
    for (std::size_t h = 0; h < town().bytes.size(); ++h) {
      Rgb rgb = town().bytes[h];
      change(h, rgb);
      test::write_bytes(path("town/" + name_of(h) + ".png"), test::png_of(rgb, kSide, kSide, 3));
    }
  }
  Finished stitch(const Words& more) const {
    Words words{"stitch"};
    words.insert(words.end(), more.begin(), more.end());
    return nodal(words);
  }
};

TEST_F(BadInput, AMirroredPicture_IsNamedWithWhatToDo) {
  write_town([](std::size_t head, Rgb& rgb) {
    if (head != 1) return;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide / 2; ++x)
        std::swap_ranges(rgb.begin() + 3 * (y * kSide + x), rgb.begin() + 3 * (y * kSide + x + 1),
                         rgb.begin() + 3 * (y * kSide + kSide - 1 - x));
    }
  });
  const Finished run = stitch({path("town"), "-o", path("s.jpg")});
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find(name_of(1) + ".png is left out: it seems to be mirrored"), std::string::npos) << run.err;
}

TEST_F(BadInput, APictureOfTwiceTheSize_IsPlacedAsTheOthers) {
  write_town();
  Rgb large;
  for (int y = 0; y < 2 * kSide; ++y) {
    for (int x = 0; x < 2 * kSide; ++x) {
      const auto from = town().bytes[2].begin() + 3 * (y / 2 * kSide + x / 2);
      large.insert(large.end(), from, from + 3);
    }
  }
  test::write_bytes(path("town/" + name_of(2) + ".png"), test::png_of(large, 2 * kSide, 2 * kSide, 3));
  const Finished run = stitch({path("town"), "-o", path("s.jpg")});
  ASSERT_EQ(run.code, 0) << run.err;
  const auto found = parse_calibration(read("s.rig.json"));
  ASSERT_TRUE(found);
  ASSERT_EQ(found->heads.size(), 6U);
  EXPECT_LT(test::rotation_error(town().truth, *found).max_deg, 1);
}

TEST_F(BadInput, ADiskThatFills_LeavesNothingThatWouldStopTheNextRun) {
  write_town();
  fs::create_directory(path("disk"));
  if (::mount("tmpfs", path("disk").c_str(), "tmpfs", 0, "size=16k") != 0) {
    GTEST_SKIP() << "mounting a small disk takes root";
  }
  const Finished run = stitch({path("town"), "--width", "512", "-o", path("disk/s.png")});
  EXPECT_EQ(run.code, 6);
  EXPECT_NE(run.err.find("s.png: the disk is full; make room, or write elsewhere with --out"), std::string::npos)
      << run.err;
  EXPECT_TRUE(fs::is_empty(path("disk")));
  ::umount2(path("disk").c_str(), MNT_DETACH);
}

}  // namespace
}  // namespace nodal::command_line
