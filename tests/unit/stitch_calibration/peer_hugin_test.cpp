// Imported projects against Hugin itself: its pano_trafo says where a picture's pixel falls in the panorama, and
// our head must see that panorama pixel's ray at the same place.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "files.h"
#include "stitch/calibration/import.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::calibration {
namespace {

using geometry::Head;
using geometry::Pixel;

bool there_is_pano_trafo() { return std::system("command -v pano_trafo > /dev/null 2>&1") == 0; }

#define NODAL_PANO_TRAFO_OR_SKIP() \
  if (!there_is_pano_trafo()) GTEST_SKIP() << "pano_trafo is not installed (Debian: hugin-tools)"

struct Place {
  std::size_t image;
  Pixel pixel;  // Hugin's: centres at integers
};

/// Where Hugin puts the places in the panorama, in its own pixels.
std::vector<Pixel> by_hugin(const std::string& project, const std::vector<Place>& places) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("nodal_hugin_" + std::to_string(std::random_device()()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "in.pto") << project;
  std::ofstream in(folder / "in.txt");
  in.precision(17);
  for (const Place& place : places) in << place.image << ' ' << place.pixel.x << ' ' << place.pixel.y << '\n';
  in.close();
  const std::string command = "LC_ALL=C pano_trafo " + (folder / "in.pto").string() + " < " +
                              (folder / "in.txt").string() + " > " + (folder / "out.txt").string() +
                              " 2> /dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::ifstream out(folder / "out.txt");
  std::vector<Pixel> result;
  for (Pixel p; out >> p.x >> p.y;) result.push_back(p);
  std::filesystem::remove_all(folder);
  return result;
}

/// The largest distance, in picture pixels, between where we and Hugin see the same ray; pictures are sampled
/// on a grid inside their regions.
double worst_disagreement(const std::string& project, int panorama_width) {
  const Result<ImportResult> import = import_pto(project, "peer");
  EXPECT_TRUE(import) << (import ? "" : import.error().text());
  if (!import) return HUGE_VAL;
  const Result<std::vector<Head>> heads = geometry::make_heads(import->calibration);
  std::vector<Place> places;
  for (std::size_t i = 0; i < heads->size(); ++i) {
    const Head& head = (*heads)[i];
    for (double y = 0.03; y < 1; y += 0.094) {
      for (double x = 0.03; x < 1; x += 0.094) {
        const Pixel pixel{x * head.width(), y * head.height()};
        if (head.contains(pixel)) places.push_back({i, {pixel.x - 0.5, pixel.y - 0.5}});
      }
    }
  }
  const std::vector<Pixel> there = by_hugin(project, places);
  EXPECT_EQ(there.size(), places.size());
  if (there.size() != places.size()) return HUGE_VAL;
  const auto panorama = *geometry::make_layout("equirectangular", panorama_width, panorama_width / 2);
  double worst = 0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const double x = std::fmod(there[k].x + 0.5 + panorama_width, panorama_width);
    const auto ray = panorama->ray(x, there[k].y + 0.5);
    const auto pixel = ray ? (*heads)[places[k].image].project(*ray) : std::nullopt;
    EXPECT_TRUE(pixel) << places[k].image << ": " << places[k].pixel.x << "," << places[k].pixel.y;
    if (!pixel) return HUGE_VAL;
    worst = std::max(worst, std::hypot(pixel->x - 0.5 - places[k].pixel.x, pixel->y - 0.5 - places[k].pixel.y));
  }
  return worst;
}

TEST(PeerHugin, SyntheticTenHeads_AgreeToAFiftiethOfAPixel) {
  NODAL_PANO_TRAFO_OR_SKIP();
  NODAL_SHARED_FILE_OR_SKIP(project, "synthetic_10head/hugin_prior.pto");
  const double worst = worst_disagreement(project, 2048);
  RecordProperty("worst_px", std::to_string(worst));
  EXPECT_LE(worst, 0.02);
}

TEST(PeerHugin, KodakFisheyesOf224Degrees_AgreeToAFiftiethOfAPixel) {
  NODAL_PANO_TRAFO_OR_SKIP();
  NODAL_SHARED_FILE_OR_SKIP(project, "calibrations/kodak_dualfisheye.pto");
  const double worst = worst_disagreement(project, 3184);
  RecordProperty("worst_px", std::to_string(worst));
  EXPECT_LE(worst, 0.02);
}

TEST(PeerHugin, EveryLensTypeWithEveryNumberSet_AgreesToAFiftiethOfAPixel) {
  NODAL_PANO_TRAFO_OR_SKIP();
  // Portrait and landscape, both signs of every angle, links, crops: what the files above lack.
  const std::string project =
      "p f2 w4000 h2000 v360 n\"TIFF\"\n"
      "i w1000 h600 f0 v70 a0.01 b-0.03 c0.02 d7.5 e-3.25 y20 p-35 r12 n\"a.png\"\n"
      "i w600 h1000 f0 v=0 a0 b0.01 c0 d-4 e2 y-110 p60 r-170 n\"b.png\"\n"
      "i w1200 h900 f3 v140 a-0.02 b0.05 c-0.04 d-11 e8 y170 p5 r95 n\"c.png\"\n"
      "i w900 h1200 f3 v=2 a=2 b=2 c=2 d=2 e=2 y-60 p-80 r33 n\"d.png\"\n"
      "i w1600 h1200 f2 v200 a0.03 b-0.06 c0.01 d5 e6 y77 p-13 r-45 S210,1400,20,1190 n\"e.png\"\n";
  const double worst = worst_disagreement(project, 4000);
  RecordProperty("worst_px", std::to_string(worst));
  EXPECT_LE(worst, 0.02);
}

}  // namespace
}  // namespace nodal::calibration
