// A rig written for another program and read back is the same, to the accuracy that the format reports.
#include "stitch/interchange/export.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/calibration/difference.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

HeadCalibration head_with(const std::string& name, const LensModel& lens, const geometry::YawPitchRoll& turn) {
  HeadCalibration head;
  head.name = name;
  head.width = 720;
  head.height = 480;
  head.center_x = 363.4;
  head.center_y = 232.9;
  head.lens = lens;
  head.region = {0, 0, 720, 480, {}};
  head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig(turn));
  head.vignetting = {head.center_x, head.center_y, 430, {}};
  return head;
}

Calibration rig_of(const LensModel& lens, double aspect = 1) {
  Calibration rig;
  rig.name = "rig";
  rig.heads.push_back(head_with("left", lens, {-40, 10, 3}));
  rig.heads.push_back(head_with("right", lens, {55, -12, -170}));
  for (HeadCalibration& head : rig.heads) head.aspect = aspect;
  return rig;
}

struct RoundTrip {
  double turned_deg = 0;
  double lens_px = 0;  ///< largest
  double told_px = 0;  ///< largest
  std::vector<std::string> notes;
};

/// Writes, reads back and compares. OpenCV's files hold one camera each and no rig; they are combined again.
RoundTrip there_and_back(const Calibration& rig, ExportFormat format, const ExportOptions& options = {}) {
  RoundTrip trip;
  const auto exported = export_calibration(rig, format, options);
  EXPECT_TRUE(exported) << (exported ? "" : exported.error().text());
  if (!exported) return trip;
  trip.notes = exported->notes;
  for (const ExportedHead& head : exported->heads) trip.told_px = std::max(trip.told_px, head.max_px);
  Calibration back;
  for (const ExportedFile& file : exported->files) {
    const auto imported = import_project(file.text, "rig");
    EXPECT_TRUE(imported) << (imported ? "" : imported.error().text()) << "\n" << file.text;
    if (!imported) return trip;
    for (HeadCalibration head : imported->calibration.heads) {
      if (!file.head.empty()) head.R_head_rig = rig.heads[back.heads.size()].R_head_rig;
      back.heads.push_back(head);
    }
  }
  EXPECT_EQ(back.heads.size(), rig.heads.size());
  for (std::size_t i = 0; i < back.heads.size(); ++i) back.heads[i].name = rig.heads[i].name;
  back.name = "rig";
  const auto difference = calibration::difference_of(rig, back);
  EXPECT_TRUE(difference) << (difference ? "" : difference.error().text());
  if (!difference) return trip;
  for (const calibration::HeadDifference& head : difference->heads) {
    trip.turned_deg = std::max(trip.turned_deg, head.turned_deg);
    trip.lens_px = std::max(trip.lens_px, head.lens_max_px);
  }
  return trip;
}

const TsaiLens kPaper{490, 2.29e-6, 1.65e-11};
const KannalaBrandtLens kFisheye{250, {-0.02, 0.003, -0.001, 0.0001}};
const EquidistantLens kPanotools{{260, -4, 3, -2}};
const RectilinearLens kPlain{{500}};

constexpr std::array kAll{ExportFormat::kHugin,       ExportFormat::kPtgui,  ExportFormat::kVideoStitch,
                          ExportFormat::kSurround360, ExportFormat::kOpenCv, ExportFormat::kKalibr};

TEST(Export, EveryFormatAndLens_ComesBackAsFarOffAsItWasTold) {
  for (const LensModel& lens : {LensModel(kPaper), LensModel(kFisheye), LensModel(kPanotools), LensModel(kPlain)}) {
    for (const ExportFormat format : kAll) {
      const RoundTrip trip = there_and_back(rig_of(lens), format);
      EXPECT_LT(trip.turned_deg, 1e-5) << static_cast<int>(format);
      EXPECT_LE(trip.lens_px, trip.told_px + 1e-3) << static_cast<int>(format) << " lens " << lens.index();
      EXPECT_LT(trip.told_px, 2.5) << static_cast<int>(format) << " lens " << lens.index();
    }
  }
}

TEST(Export, LensThatTheFormatHolds_IsExact) {
  EXPECT_LT(there_and_back(rig_of(kPanotools), ExportFormat::kHugin).lens_px, 1e-6);
  EXPECT_LT(there_and_back(rig_of(kPanotools), ExportFormat::kPtgui).lens_px, 1e-6);
  EXPECT_LT(there_and_back(rig_of(kPanotools, 1.083), ExportFormat::kVideoStitch).lens_px, 1e-6);
  EXPECT_LT(there_and_back(rig_of(kFisheye, 1.083), ExportFormat::kOpenCv).lens_px, 1e-6);
  EXPECT_LT(there_and_back(rig_of(kFisheye, 1.083), ExportFormat::kKalibr).lens_px, 1e-6);
  EXPECT_LT(there_and_back(rig_of(kPlain, 0.9), ExportFormat::kSurround360).lens_px, 1e-6);
}

TEST(Export, LensOfThePaper_IsOffByWhatOtherProgramsModelsAllow) {
  // Measured once with other tools: OpenCV's rational model 0.003 px rms, Kannala-Brandt 0.07, Hugin's fisheye 0.08.
  const auto rms = [](ExportFormat format) { return export_calibration(rig_of(kPaper), format)->heads[0].rms_px; };
  EXPECT_LT(rms(ExportFormat::kOpenCv), 0.01);
  EXPECT_LT(rms(ExportFormat::kKalibr), 0.1);
  EXPECT_LT(rms(ExportFormat::kHugin), 0.12);
}

TEST(Export, OblongPixels_AreSqueezedOrResampledAndToldEitherWay) {
  const Calibration rig = rig_of(kPanotools, 1.083);
  const auto squeezed = export_calibration(rig, ExportFormat::kHugin);
  ASSERT_TRUE(squeezed);
  EXPECT_GT(squeezed->heads[0].max_px, 5);
  EXPECT_TRUE(
      std::ranges::any_of(squeezed->notes, [](const std::string& n) { return n.find("--square-pixels") != n.npos; }));

  const auto square = export_calibration(rig, ExportFormat::kHugin, {.images = {}, .square_pixels = true});
  ASSERT_TRUE(square);
  EXPECT_LT(square->heads[0].max_px, 0.2);
  EXPECT_NE(square->files[0].text.find("i w780 h480"), std::string::npos);
  EXPECT_TRUE(std::ranges::any_of(square->notes, [](const std::string& n) { return n.find("780x480") != n.npos; }));
}

TEST(Export, FisheyeBeyond90Degrees_IsWrittenWithAnglesEverywhere) {
  Calibration rig = rig_of(KannalaBrandtLens{210, {-0.02, 0.003, -0.001, 0.0001}});
  for (const ExportFormat format : kAll) {
    const RoundTrip trip = there_and_back(rig, format);
    EXPECT_LE(trip.lens_px, trip.told_px + 1e-3) << static_cast<int>(format);
    EXPECT_LT(trip.told_px, 3) << static_cast<int>(format);
  }
}

TEST(Export, CircleGainAndVignetting_SurviveInHugin) {
  Calibration rig = rig_of(kPanotools);
  rig.heads[0].region.circle = Region::Circle{360, 240, 200};
  rig.heads[0].gain = {0.8, 0.8, 0.8};
  rig.heads[1].gain = {1.25, 1.25, 1.25};
  rig.heads[0].vignetting.coefficients = {-0.3, 0.05, -0.01};
  const auto exported = export_calibration(rig, ExportFormat::kHugin);
  ASSERT_TRUE(exported) << exported.error().text();
  const auto back = import_project(exported->files[0].text, "rig");
  ASSERT_TRUE(back) << back.error().text();
  const HeadCalibration& head = back->calibration.heads[0];
  ASSERT_TRUE(head.region.circle);
  EXPECT_NEAR(head.region.circle->radius, 200, 0.5);
  EXPECT_NEAR(head.gain[0], 0.8, 1e-9);
  EXPECT_NEAR(back->calibration.heads[1].gain[2], 1.25, 1e-9);
  const auto fall_off = [](const HeadCalibration& h, double x, double y) {
    const double s = std::pow(std::hypot(x - h.vignetting.x, y - h.vignetting.y) / h.vignetting.radius, 2);
    const auto& v = h.vignetting.coefficients;
    return 1 + s * (v[0] + s * (v[1] + s * v[2]));
  };
  for (const double x : {50.0, 200.0, 500.0}) EXPECT_NEAR(fall_off(head, x, 100), fall_off(rig.heads[0], x, 100), 1e-9);
}

TEST(Export, HeadsNames_ComeBackFromKalibrAndSurround360) {
  for (const ExportFormat format : {ExportFormat::kKalibr, ExportFormat::kSurround360}) {
    const auto exported = export_calibration(rig_of(kPlain), format);
    ASSERT_TRUE(exported) << exported.error().text();
    const auto back = import_project(exported->files[0].text, "rig");
    ASSERT_TRUE(back) << back.error().text();
    EXPECT_EQ(back->calibration.heads[0].name, "left");
    EXPECT_EQ(back->calibration.heads[1].name, "right");
  }
}

TEST(Export, PositionsOfHeads_ComeBackFromKalibrAndSurround360) {
  Calibration rig = rig_of(kPlain);
  rig.heads[0].position = {0.1, -0.02, 0.03};
  rig.heads[1].position = {-0.07, 0.05, 0.2};
  const auto vector = [](const HeadCalibration& head) {
    return Eigen::Vector3d(head.position[0], head.position[1], head.position[2]);
  };
  const auto rotation = [](const HeadCalibration& head) { return geometry::matrix_of(head.R_head_rig); };
  for (const ExportFormat format : {ExportFormat::kKalibr, ExportFormat::kSurround360}) {
    const auto exported = export_calibration(rig, format);
    ASSERT_TRUE(exported) << exported.error().text();
    const auto back = import_project(exported->files[0].text, "rig");
    ASSERT_TRUE(back) << back.error().text();
    const auto& heads = back->calibration.heads;
    // A chain has its own rig frame, but each head sees the other in the same place.
    const Eigen::Vector3d was = rotation(rig.heads[0]) * (vector(rig.heads[1]) - vector(rig.heads[0]));
    const Eigen::Vector3d is = rotation(heads[0]) * (vector(heads[1]) - vector(heads[0]));
    EXPECT_LT((was - is).norm(), 1e-6) << static_cast<int>(format);
    const Eigen::Vector3d first =
        format == ExportFormat::kKalibr ? Eigen::Vector3d(-vector(heads[1])) : vector(rig.heads[0]);
    EXPECT_LT((vector(heads[0]) - first).norm(), 1e-6);
  }
}

TEST(Export, UnknownFormat_IsRefusedWithThoseThereAre) {
  const auto refused = export_format_named("pdf");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("kalibr"), std::string::npos);
  EXPECT_EQ(*export_format_named("ptv"), ExportFormat::kVideoStitch);
}

TEST(Export, Masks_GoThereAndBackByHuginAndAreNotedElsewhere) {
  for (const double aspect : {1.0, 1.25}) {
    Calibration rig = rig_of(RectilinearLens{{500}}, aspect);
    rig.heads[1].region.masks = {{{10.25, 20}, {300, -5}, {200, 400.5}}, {{600, 5}, {700, 5}, {700, 90}, {600, 90}}};
    const auto hugin = export_calibration(rig, ExportFormat::kHugin, {});
    ASSERT_TRUE(hugin);
    const auto back = import_project(hugin->files.at(0).text, "rig");
    ASSERT_TRUE(back) << back.error().text();
    EXPECT_TRUE(back->calibration.heads[0].region.masks.empty());
    if (aspect == 1) {
      EXPECT_EQ(back->calibration.heads[1].region.masks, rig.heads[1].region.masks);
    }
    EXPECT_EQ(back->calibration.heads[1].region.masks.size(), 2U);
    for (const ExportFormat format : {ExportFormat::kPtgui, ExportFormat::kVideoStitch, ExportFormat::kOpenCv}) {
      const auto other = export_calibration(rig, format, {});
      ASSERT_TRUE(other);
      const bool noted = std::ranges::any_of(other->notes, [](const std::string& note) {
        return note.find("masks of head 'right'") != std::string::npos;
      });
      EXPECT_TRUE(noted);
    }
  }
}

}  // namespace
}  // namespace nodal::interchange
