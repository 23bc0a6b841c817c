// The sharpness of the raymap where heads overlap, by transition, on real rigs and on the rendered one.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>
#include <optional>

#include "stitch/blend/blend.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/import.h"
#include "stitch/media/image_file.h"
#include "stitch/offline/best_blend.h"
#include "stitch/table/ray_sampler.h"
#include "stitch/table/table_compiler.h"
#include "tests/data/truth_rig.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"
#include "tests/reference/score.h"

namespace nodal::test {
namespace {

namespace fs = std::filesystem;
using table::TableOptions;

const fs::path kData = fs::path(NODAL_SHARED_DIR) / "data";

std::string read_text(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

TableOptions feather(double part) {
  TableOptions options;
  options.transition = Transition::kFeather;
  options.feather = part;
  return options;
}

TableOptions seam(double degrees) {
  TableOptions options;
  options.transition = Transition::kSeam;
  options.seam_width_deg = degrees;
  return options;
}

TableOptions two_bands(double degrees) {
  TableOptions options;
  options.transition = Transition::kTwoBand;
  options.seam_width_deg = degrees;
  return options;
}

struct Set {
  Calibration rig;
  std::vector<DecodedImage> pictures;
  int width = 2048;

  std::unique_ptr<geometry::RaymapLayout> layout() const {
    return geometry::make_layout("equirectangular", width, width / 2).value();
  }
  Picture stitched(const TableOptions& options) const {
    std::vector<ImageView> views;
    for (const DecodedImage& picture : pictures) views.push_back(picture.view());
    const std::vector<PixelFormat> formats(views.size(), PixelFormat::kRgb24);
    const auto table = table::compile_blend_table(rig, *layout(), PixelFormat::kRgb24, formats, options).value();
    Picture raymap(PixelFormat::kRgb24, width, width / 2);
    blend::blend_rows(table, PreparedHeads(table, views).views(), blend::calibrated_tone(table), raymap.mutable_view(),
                      0, width / 2);
    return raymap;
  }
};

/// Pixels seen by two or more heads, at least 8 px inside their regions.
std::vector<bool> overlap_of(const Set& set) {
  const auto layout = set.layout();
  std::vector<geometry::Head> heads = geometry::make_heads(set.rig).value();
  std::vector<bool> overlap;
  for (int y = 0; y < set.width / 2; ++y) {
    for (int x = 0; x < set.width; ++x) {
      int seen = 0;
      for (const geometry::Head& head : heads) {
        const auto pixel = head.project(*layout->ray(x + 0.5, y + 0.5));
        seen += pixel && head.distance_to_edge(*pixel) >= 8 ? 1 : 0;
      }
      overlap.push_back(seen >= 2);
    }
  }
  return overlap;
}

/// The difference of a pixel's luma from the mean over 5x5 pixels.
double fine_detail(const Picture& raymap, int x, int y) {
  const auto luma = [&](int i, int j) {
    const auto column = static_cast<std::size_t>((i + raymap.width) % raymap.width);
    const std::uint8_t* p =
        raymap.bytes.data() + 3 * (static_cast<std::size_t>(j) * static_cast<std::size_t>(raymap.width) + column);
    return 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
  };
  double mean = 0;
  for (int j = -2; j <= 2; ++j) {
    for (int i = -2; i <= 2; ++i) mean += luma(x + i, y + j) / 25;
  }
  return std::abs(luma(x, y) - mean);
}

/// Fine contrast of a raymap where heads overlap, relative to that of each pixel's best head alone, without any seam.
class Contrast {
 public:
  explicit Contrast(const Set& set) : set_(set), overlap_(overlap_of(set)) {
    std::vector<Picture> alone;
    for (std::size_t h = 0; h < set.rig.heads.size(); ++h) {
      Set one{{set.rig.name, "", {set.rig.heads[h]}},
              {media::convert_image(set.pictures[h].view(), PixelFormat::kRgb24)},
              set.width};
      alone.push_back(one.stitched(seam(0)));
    }
    const auto layout = set.layout();
    const std::vector<PixelFormat> formats(set.rig.heads.size(), PixelFormat::kRgb24);
    const auto sampler = table::RaySampler::make(set.rig, *layout, PixelFormat::kRgb24, formats, seam(0)).value();
    table::RowSampler row(sampler);
    best_head_ = mean([&](int x, int y) {
      if (y != row_) row.sample(0, row_ = y);
      return fine_detail(alone[row.at(x)[0].head], x, y);
    });
  }
  double of(const TableOptions& options) const {
    const Picture raymap = set_.stitched(options);
    return mean([&](int x, int y) { return fine_detail(raymap, x, y); }) / best_head_;
  }

 private:
  /// Over the overlap, weighted by solid angle.
  template <class Detail>
  double mean(Detail detail) const {
    double sum = 0, weight = 0;
    const int height = set_.width / 2;
    for (int y = 2; y < height - 2; ++y) {
      const double solid = std::cos(((y + 0.5) / height - 0.5) * std::numbers::pi);
      for (int x = 0; x < set_.width; ++x) {
        if (!overlap_[static_cast<std::size_t>(y) * static_cast<std::size_t>(set_.width) + static_cast<std::size_t>(x)])
          continue;
        sum += solid * detail(x, y);
        weight += solid;
      }
    }
    return sum / weight;
  }

  const Set& set_;
  std::vector<bool> overlap_;
  int row_ = -1;
  double best_head_ = 0;
};

struct Row {
  const char* name;
  TableOptions options;
};
const Row kRows[] = {{"feather 0.5", feather(0.5)},
                     {"feather 0.05", feather(0.05)},
                     {"seam 10", seam(10)},
                     {"seam 4", seam(4)},
                     {"seam 2", seam(2)},
                     {"seam 1", seam(1)},
                     {"seam 0.5", seam(0.5)},
                     {"two bands 4", two_bands(4)},
                     {"two bands 2", two_bands(2)},
                     {"two bands 1", two_bands(1)},
                     {"two bands 0.5", two_bands(0.5)}};

/// To look at: the raymaps of `set` as $NODAL_PICTURES/<name>-<transition>.png.
void write_pictures(const char* name, const Set& set) {
  const char* const folder = std::getenv("NODAL_PICTURES");
  if (folder == nullptr) return;
  for (const Row& row : kRows) {
    ASSERT_TRUE(write_png(fs::path(folder) / (std::string(name) + "-" + row.name + ".png"), set.stitched(row.options)));
  }
}

/// Prints a row for each transition; returns the contrast of a seam of one degree.
double table_of(const char* name, const Set& set) {
  const Contrast contrast(set);
  write_pictures(name, set);
  for (const Row& row : kRows) std::printf("%-18s %-12s %.3f\n", name, row.name, contrast.of(row.options));
  return contrast.of(seam(1));
}

std::optional<Set> fusion() {
  const fs::path folder = kData / "gopro_fusion" / "testframes" / "3k" / "single";
  if (!fs::exists(folder / "FR" / "GPFR0003_img1.jpg")) return std::nullopt;
  Set set;
  for (const char* name : {"FR/GPFR0003_img1.jpg", "BK/GPBK0003_img1.jpg"}) {
    set.pictures.push_back(media::read_image(folder / name, PixelFormat::kRgb24).value());
    // From parameter-examples/video-3k-mode.txt: circle and field of view.
    HeadCalibration head;
    head.name = set.rig.heads.empty() ? "front" : "back";
    head.width = set.pictures.back().view().width;
    head.height = set.pictures.back().view().height;
    head.center_x = 779;
    head.center_y = 742;
    head.max_angle = 95 * std::numbers::pi / 180;
    head.lens = EquidistantLens{{765 / head.max_angle}};
    head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig({set.rig.heads.empty() ? 0.0 : 180.0, 0, 0}));
    head.region = {0, 0, static_cast<double>(head.width), static_cast<double>(head.height),
                   Region::Circle{779, 742, 760}};
    head.vignetting = {779, 742, 765, {}};
    head.gain.fill(set.rig.heads.empty() ? 0.816 : 1.225);  // the result of `nodal register --free light`
    set.rig.heads.push_back(head);
  }
  set.rig.name = "fusion";
  return set;
}

std::optional<Set> rooftop() {
  const fs::path folder = kData / "stitchem_3cam";
  if (!fs::exists(folder / "3_Cam_-_Sample.pts")) return std::nullopt;
  Set set;
  set.rig = interchange::import_project(read_text(folder / "3_Cam_-_Sample.pts"), "rooftop").value().calibration;
  for (const char* name : {"input-00.jpg", "input-01.jpg", "input-02.jpg"}) {
    set.pictures.push_back(media::read_image(folder / name, PixelFormat::kRgb24).value());
  }
  return set;
}

TEST(Transitions, TwoFisheyesBackToBack_ASeamKeepsTheBestHeadsContrast) {
  const std::optional<Set> set = fusion();
  if (!set) GTEST_SKIP() << "gopro_fusion is not there";
  EXPECT_GE(table_of("gopro_fusion", *set), 0.95);
}

TEST(Transitions, ThreeFisheyesOnARoof_ASeamKeepsTheBestHeadsContrast) {
  const std::optional<Set> set = rooftop();
  if (!set) GTEST_SKIP() << "stitchem_3cam is not there";
  EXPECT_GE(table_of("stitchem_3cam", *set), 0.95);
}

TEST(Transitions, TenHeadsOfOneNodalPoint_PsnrByTransition) {
  const fs::path folder = kData / "synthetic_10head";
  if (!fs::exists(folder / "rig_gt.json")) GTEST_SKIP() << folder << " is not there";
  Set set;
  const test_data::TruthRig rig = test_data::read_truth_rig(read_text(folder / "rig_gt.json")).value();
  set.rig = rig.calibration;
  for (const std::string& image : rig.images) {
    set.pictures.push_back(media::read_image(folder / image, PixelFormat::kRgb24).value());
  }
  const Picture truth = read_png(folder / "gt_equirect_2048.png").value();
  const auto psnr = [&](const TableOptions& options) {
    return score(set.stitched(options).view(), truth.view(), *set.layout()).psnr_db;
  };
  for (const Row& row : kRows) std::printf("%-18s %-12s %.2f dB\n", "synthetic_10head", row.name, psnr(row.options));
  std::vector<ImageView> views;
  for (const DecodedImage& picture : set.pictures) views.push_back(picture.view());
  auto best = offline::BestBlend::make(set.rig, {"equirectangular", set.width, set.width / 2, PixelFormat::kRgb24}, 0);
  ASSERT_TRUE(best) << best.error().text();
  const DecodedImage blended = best->blend(views).value();
  const double best_db = score(blended.view(), truth.view(), *set.layout()).psnr_db;
  std::printf("%-18s %-12s %.2f dB\n", "synthetic_10head", "best", best_db);
  // Cubic taps keep more noise than the board's bilinear ones, which costs about as much as their detail gains.
  EXPECT_GE(best_db, psnr(two_bands(1)) - 0.15);
  // With a common nodal point, a seam loses only the averaging of two noises: 36.39 measured.
  EXPECT_GE(psnr(seam(1)), 36.35);
  EXPECT_LE(psnr(seam(1)), psnr(feather(0.5)));
}

}  // namespace
}  // namespace nodal::test
