// Imported and exported projects against Hugin itself: its pano_trafo gives the panorama pixel of a picture's pixel,
// and our head must project that panorama pixel's ray to the same picture pixel.
#include <gtest/gtest.h>

#include <cmath>

#include "files.h"
#include "hugin.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/export.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

/// The same for heads that we import from that project.
double imported_disagreement(const std::string& project, int panorama_width) {
  const Result<ImportResult> import = import_pto(project, "peer");
  EXPECT_TRUE(import) << (import ? "" : import.error().text());
  if (!import) return HUGE_VAL;
  return worst_disagreement(project, *geometry::make_heads(import->calibration), panorama_width);
}

TEST(PeerHugin, SyntheticTenHeads_AgreeToAFiftiethOfAPixel) {
  NODAL_PANO_TRAFO_OR_SKIP();
  NODAL_SHARED_FILE_OR_SKIP(project, "synthetic_10head/hugin_prior.pto");
  const double worst = imported_disagreement(project, 2048);
  RecordProperty("worst_px", std::to_string(worst));
  EXPECT_LE(worst, 0.02);
}

TEST(PeerHugin, KodakFisheyesOf224Degrees_AgreeToAFiftiethOfAPixel) {
  NODAL_PANO_TRAFO_OR_SKIP();
  NODAL_SHARED_FILE_OR_SKIP(project, "calibrations/kodak_dualfisheye.pto");
  const double worst = imported_disagreement(project, 3184);
  RecordProperty("worst_px", std::to_string(worst));
  EXPECT_LE(worst, 0.02);
}

TEST(PeerHugin, EveryLensTypeWithEveryNumberSet_AgreesToAFiftiethOfAPixel) {
  NODAL_PANO_TRAFO_OR_SKIP();
  // Portrait and landscape, both signs of every angle, links, crops: cases that the files above lack.
  const std::string project =
      "p f2 w4000 h2000 v360 n\"TIFF\"\n"
      "i w1000 h600 f0 v70 a0.01 b-0.03 c0.02 d7.5 e-3.25 y20 p-35 r12 n\"a.png\"\n"
      "i w600 h1000 f0 v=0 a0 b0.01 c0 d-4 e2 y-110 p60 r-170 n\"b.png\"\n"
      "i w1200 h900 f3 v140 a-0.02 b0.05 c-0.04 d-11 e8 y170 p5 r95 n\"c.png\"\n"
      "i w900 h1200 f3 v=2 a=2 b=2 c=2 d=2 e=2 y-60 p-80 r33 n\"d.png\"\n"
      "i w1600 h1200 f2 v200 a0.03 b-0.06 c0.01 d5 e6 y77 p-13 r-45 S210,1400,20,1190 n\"e.png\"\n";
  const double worst = imported_disagreement(project, 4000);
  RecordProperty("worst_px", std::to_string(worst));
  EXPECT_LE(worst, 0.02);
}

/// A rig with lenses that Hugin lacks: two heads of the paper's kind, square pixels, and a fisheye of 200 degrees.
Calibration foreign_rig() {
  Calibration rig;
  rig.name = "foreign";
  for (int i = 0; i < 3; ++i) {
    HeadCalibration head;
    head.name = "head" + std::to_string(i);
    head.width = i == 2 ? 1200 : 720;
    head.height = i == 2 ? 1200 : 480;
    head.center_x = head.width / 2.0 + 4.3;
    head.center_y = head.height / 2.0 - 7.1;
    head.region = {0, 0, static_cast<double>(head.width), static_cast<double>(head.height), {}};
    head.lens = TsaiLens{490, 2.29e-6, 1.65e-11};
    head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig({120.0 * i - 50, 20.0 * i - 10, 33.0 - 60 * i}));
    head.vignetting = {head.center_x, head.center_y, 400, {}};
    if (i == 2) {
      head.lens = KannalaBrandtLens{330, {-0.02, 0.003, -0.0005, 0}};
      head.region.circle = Region::Circle{610, 590, 550};
    }
    rig.heads.push_back(head);
  }
  return rig;
}

TEST(PeerHugin, RigOfForeignLensesExported_HuginSeesItAsTheResidualSays) {
  NODAL_PANO_TRAFO_OR_SKIP();
  const Calibration rig = foreign_rig();
  const auto exported = export_calibration(rig, ExportFormat::kHugin);
  ASSERT_TRUE(exported) << exported.error().text();
  double stated = 0;
  for (const ExportedHead& head : exported->heads) stated = std::max(stated, head.max_px);
  const double worst = worst_disagreement(exported->files.at(0).text, *geometry::make_heads(rig), 4096);
  RecordProperty("worst_px", std::to_string(worst));
  RecordProperty("told_px", std::to_string(stated));
  EXPECT_LE(worst, stated + 0.03);
  EXPECT_LT(stated, 1.0);
}

}  // namespace
}  // namespace nodal::interchange
