// The displacement that warnings state, against what the true rig says about it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "stitch/geometry/head.h"
#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

/// The displacement, px, that a warning states after "by about".
double stated_px(const Report& report) {
  const std::string before = "displaced against each other by about ";
  for (const std::string& warning : report.warnings) {
    if (const std::size_t at = warning.find(before); at != std::string::npos) {
      return std::strtod(warning.c_str() + at + before.size(), nullptr);
    }
  }
  return 0;
}

/// Squared change of the light at a pixel: how much detail there is to be seen displaced.
double detail_at(const ImageView& frame, int x, int y) {
  if (x < 1 || y < 1 || x + 1 >= frame.width || y + 1 >= frame.height) return 0;
  const auto level = [&](int i, int j) {
    return static_cast<double>(frame.planes[0].data[j * frame.planes[0].row_stride + i]);
  };
  return std::pow(level(x + 1, y) - level(x - 1, y), 2) + std::pow(level(x, y + 1) - level(x, y - 1), 2);
}

/// Rms over the detail that two heads see: how far apart a calibration says that the heads show one point of the scene,
/// px.
double displacement(const test::RenderedRig& rig, const Calibration& found) {
  const Calibration& truth = rig.truth;
  const std::vector<ImageView> frames = rig.frames();
  const auto is = geometry::make_heads(truth).value(), says = geometry::make_heads(found).value();
  double sum = 0, count = 0;
  for (std::size_t a = 0; a < is.size(); ++a) {
    for (std::size_t b = 0; b < is.size(); ++b) {
      for (int y = 2; a != b && y < is[a].height(); y += 4) {
        for (int x = 2; x < is[a].width(); x += 4) {
          const geometry::Pixel at{x + 0.5, y + 0.5};
          if (!is[a].contains(at)) continue;
          const auto ray = is[a].unproject(at), moved = says[a].unproject(at);
          const auto projected = ray ? is[b].project(*ray) : std::nullopt;
          const auto stated = moved ? says[b].project(*moved) : std::nullopt;
          if (!projected || !stated || !is[b].contains(*projected)) continue;
          const double detail = detail_at(frames[a], x, y);
          sum += detail * (std::pow(projected->x - stated->x, 2) + std::pow(projected->y - stated->y, 2));
          count += detail;
        }
      }
    }
  }
  return std::sqrt(sum / count);
}

TEST(RegisterSize, FocalLengthsThatAreWrong_TheStatedDisplacementIsTheTrueOne) {
  const Calibration truth = test::six_fisheyes(160);
  const test::RenderedRig rig =
      test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  for (const double percent : {0.5, 0.6, 0.7, 0.8}) {
    Calibration prior = rig.truth;
    for (HeadCalibration& head : prior.heads) std::get<EquidistantLens>(head.lens).coefficients[0] *= 1 + percent / 100;
    const Result<Report> report = register_heads(prior, {rig.frames()}, {});
    ASSERT_TRUE(report) << report.error().text();
    const double is = displacement(rig, report->calibration), says = stated_px(*report);
    EXPECT_GT(says, is / 1.3) << percent << " % off, which displaces by " << is << " px";
    EXPECT_LT(says, is * 1.1) << percent << " % off, which displaces by " << is << " px";
  }
}

}  // namespace
}  // namespace nodal::registration
