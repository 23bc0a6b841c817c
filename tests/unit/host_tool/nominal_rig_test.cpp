// Rigs by their data sheets: kinds of lenses.
#include "host_tool/input/nominal_rig.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "protocol/base/angles.h"
#include "protocol/base/decoded_image.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::host {
namespace {

constexpr double kRadius = 480;

Result<Calibration> rig_of(const std::string& rig, const std::string& lens) {
  NominalWords words;
  words.rig = rig;
  words.lens = lens;
  if (lens != "rectilinear") words.circles = {"500,500,480"};
  const Result<Nominal> nominal = nominal_of(words);
  if (!nominal) return fail(nominal.error());
  DecodedImage black;
  black.format = PixelFormat::kGrey8;
  black.width = black.height = 1000;
  black.bytes.resize(1000 * 1000);
  const std::vector<ImageView> pictures(2, black.view());
  return nominal_rig(*nominal, pictures);
}

struct Kind {
  const char* name;
  std::function<double(double)> radius;  ///< at an angle, with focal length 1: the definition of the family
  double view_deg;
};

TEST(NominalLens, EachKind_IsItsDefinitionBetweenTheMiddleAndTheCircle) {
  const std::vector<Kind> kinds{{"fisheye", [](double a) { return a; }, 220},
                                {"equidistant", [](double a) { return a; }, 220},
                                {"equisolid", [](double a) { return 2 * std::sin(a / 2); }, 220},
                                {"stereographic", [](double a) { return 2 * std::tan(a / 2); }, 220},
                                {"orthographic", [](double a) { return std::sin(a); }, 160}};
  for (const Kind& kind : kinds) {
    const auto rig = rig_of("2x" + std::to_string(static_cast<int>(kind.view_deg)), kind.name);
    ASSERT_TRUE(rig) << rig.error().text();
    const auto lens = geometry::Lens::make(rig->heads[1].lens, rig->heads[1].max_angle);
    ASSERT_TRUE(lens) << kind.name;
    const double edge = kind.view_deg / 2 * kRadiansPerDegree;
    for (int tenth = 1; tenth <= 10; ++tenth) {
      const double angle = edge * tenth / 10, right = kRadius * kind.radius(angle) / kind.radius(edge);
      ASSERT_TRUE(lens->radius(angle)) << kind.name << " " << tenth;
      EXPECT_NEAR(*lens->radius(angle) / right, 1, tenth == 10 ? 1e-9 : 4e-4) << kind.name << " " << tenth;
    }
  }
}

TEST(NominalLens, RectilinearOnes_HaveTheirViewFromEdgeToEdge) {
  const auto rig = rig_of("2x90", "rectilinear");
  ASSERT_TRUE(rig) << rig.error().text();
  EXPECT_NEAR(std::get<RectilinearLens>(rig->heads[0].lens).coefficients.at(0), 500, 1e-9);
}

TEST(NominalLens, AViewThatAKindCannotHave_IsRefusedWithTheLargestOne) {
  const auto refused = [](const std::string& rig, const std::string& lens, const std::string& says) {
    const auto made = rig_of(rig, lens);
    ASSERT_FALSE(made) << rig << lens;
    EXPECT_NE(made.error().text().find(says), std::string::npos) << made.error().text();
  };
  refused("2x190", "orthographic", "--nominal: 190 degrees, but --lens orthographic can have at most 170");
  refused("2x175", "rectilinear", "--lens rectilinear can have at most 170");
  refused("2x280", "stereographic", "--lens stereographic can have at most 270");
  refused("2x190", "fishy", "--lens: 'fishy': fisheye");
  EXPECT_TRUE(rig_of("2x300", "equisolid"));
}

}  // namespace
}  // namespace nodal::host
