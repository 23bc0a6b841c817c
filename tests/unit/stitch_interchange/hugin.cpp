#include "hugin.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::interchange {
namespace {

using geometry::Head;
using geometry::Pixel;

struct Place {
  std::size_t image;
  Pixel pixel;  // Hugin's convention: centres at integers
};

/// Hugin's pixels for the given points of the panorama.
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
                              (folder / "in.txt").string() + " > " + (folder / "out.txt").string() + " 2> /dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::ifstream out(folder / "out.txt");
  std::vector<Pixel> result;
  for (Pixel p; out >> p.x >> p.y;) result.push_back(p);
  std::filesystem::remove_all(folder);
  return result;
}

}  // namespace

bool there_is_pano_trafo() { return std::system("command -v pano_trafo > /dev/null 2>&1") == 0; }

double worst_disagreement(const std::string& project, const std::vector<Head>& heads, int panorama_width) {
  std::vector<Place> places;
  for (std::size_t i = 0; i < heads.size(); ++i) {
    const Head& head = heads[i];
    for (double y = 0.03; y < 1; y += 0.094) {
      for (double x = 0.03; x < 1; x += 0.094) {
        const Pixel pixel{x * head.width(), y * head.height()};
        if (head.contains(pixel)) places.push_back({i, {pixel.x - 0.5, pixel.y - 0.5}});
      }
    }
  }
  const std::vector<Pixel> pixels = by_hugin(project, places);
  EXPECT_EQ(pixels.size(), places.size());
  if (pixels.size() != places.size()) return HUGE_VAL;
  const auto panorama = *geometry::make_layout("equirectangular", panorama_width, panorama_width / 2);
  double worst = 0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const double x = std::fmod(pixels[k].x + 0.5 + panorama_width, panorama_width);
    const auto ray = panorama->ray(x, pixels[k].y + 0.5);
    const auto pixel = ray ? heads[places[k].image].project(*ray) : std::nullopt;
    EXPECT_TRUE(pixel) << places[k].image << ": " << places[k].pixel.x << "," << places[k].pixel.y;
    if (!pixel) return HUGE_VAL;
    worst = std::max(worst, std::hypot(pixel->x - 0.5 - places[k].pixel.x, pixel->y - 0.5 - places[k].pixel.y));
  }
  return worst;
}

}  // namespace nodal::interchange
