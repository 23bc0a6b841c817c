// Every field of another program's file is used, named as left out, or refused. Expected values are from the formats'
// formulas, written here.
#include "stitch/interchange/known_fields.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "stitch/geometry/head.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

ImportResult imported_from(const std::string& text) {
  Result<ImportResult> import = import_project(text, "rig");
  EXPECT_TRUE(import) << (import ? "" : import.error().text());
  return import ? std::move(*import) : ImportResult{};
}

bool says(const ImportResult& import, const std::string& words) {
  return std::ranges::any_of(import.notes,
                             [&](const std::string& note) { return note.find(words) != std::string::npos; });
}

std::string all_notes(const ImportResult& import) {
  std::string text;
  for (const std::string& note : import.notes) text += note + "\n";
  return text;
}

/// The angle between the axes of two heads, degrees.
double apart(const ImportResult& import, std::size_t a, std::size_t b) {
  const auto heads = *geometry::make_heads(import.calibration);
  return geometry::angle_between(heads.at(a).axis(), heads.at(b).axis()) / kDegree;
}

std::string ros(const std::string& model) {
  return "image_width: 1640\nimage_height: 1232\ncamera_name: cam\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
         "  data: [404.0, 0.0, 820.0, 0., 404.0, 616.0, 0., 0., 1.]\n" +
         model +
         "distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: [0.17, -0.03, 0.0, 0.0]\n"
         "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]\n";
}

TEST(KnownFields, RosFisheyeByItsCameraModel_IsAFisheye) {
  for (const char* model : {"camera_model: fisheye\n", "distortion_model: equidistant\n",
                            "camera_model: pinhole\ndistortion_model: equidistant\n"}) {
    const ImportResult import = imported_from(ros(model));
    ASSERT_EQ(import.calibration.heads.size(), 1u);
    const auto* lens = std::get_if<KannalaBrandtLens>(&import.calibration.heads[0].lens);
    ASSERT_NE(lens, nullptr) << model;
    EXPECT_EQ(lens->k[0], 0.17);
    EXPECT_FALSE(says(import, "eft out")) << all_notes(import);
  }
  for (const char* model : {"camera_model: spherical\n", "distortion_model: tilted\n",
                            "camera_model: fisheye\ndistortion_model: plumb_bob\n"}) {
    EXPECT_FALSE(import_project(ros(model), "rig")) << model;
  }
}

const std::string kKalibrCamera =
    "  camera_model: pinhole\n  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]\n  distortion_model: equidistant\n"
    "  intrinsics: [190.98, 190.97, 254.93, 256.9]\n  resolution: [512, 512]\n";
const std::string kNotTurned = ": [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
const std::string kTurned = ": [[0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0.5], [0, 0, 0, 1]]\n";
const std::string kTurnedInverse = ": [[0, 0, 1, -0.5], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]\n";
const std::string kNotTurnedInverse = ": [[1, 0, 0, -0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";

TEST(KnownFields, KalibrChainByTheInertialSensorOnly_HasItsOrientations) {
  for (const std::string& text :
       {"cam0:\n  T_cam_imu" + kNotTurned + kKalibrCamera + "cam1:\n  T_cam_imu" + kTurned + kKalibrCamera,
        "%YAML:1.0\n\ncam0:\n  T_imu_cam" + kNotTurnedInverse + kKalibrCamera + "cam1:\n  T_imu_cam" + kTurnedInverse +
            kKalibrCamera}) {
    const ImportResult import = imported_from(text);
    ASSERT_EQ(import.calibration.heads.size(), 2u);
    EXPECT_NEAR(apart(import, 0, 1), 90, 1e-9);
    // The camera's axis in cam0's frame is (1, 0, 0): to the right.
    EXPECT_NEAR(geometry::make_heads(import.calibration)->at(1).axis().direction().x(), 1, 1e-12);
  }
}

TEST(KnownFields, KalibrChainWithoutPlaces_SaysSo) {
  const ImportResult import = imported_from("cam0:\n" + kKalibrCamera + "cam1:\n" + kKalibrCamera);
  EXPECT_TRUE(says(import, "does not say how cam1 stands to cam0")) << all_notes(import);
  const ImportResult both = imported_from("cam0:\n  T_cam_imu" + kNotTurned + kKalibrCamera + "cam1:\n  T_cn_cnm1" +
                                          kNotTurned + "  T_cam_imu" + kTurned + kKalibrCamera);
  EXPECT_TRUE(says(both, "contradict each other")) << all_notes(both);
}

TEST(KnownFields, KalibrBehindAnOpenCvHeader_AndWithAGap) {
  const std::string text = "%YAML:1.0\n\ncam0:\n" + kKalibrCamera + "cam1:\n  T_cn_cnm1" + kTurned + kKalibrCamera;
  EXPECT_NEAR(apart(imported_from(text), 0, 1), 90, 1e-9);
  const Result<ImportResult> gap = import_project("cam0:\n" + kKalibrCamera + "cam2:\n" + kKalibrCamera, "rig");
  ASSERT_FALSE(gap);
  EXPECT_NE(gap.error().message.find("'cam2'"), std::string::npos) << gap.error().message;
}

TEST(KnownFields, OpenCvXml_GivesWhatItsYamlGives) {
  const std::string xml =
      "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>1280</image_width>\n<image_height>720</image_height>\n"
      "<camera_matrix type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt>"
      "<data>300. 0. 640.\n 0. 310. 360. 0. 0. 1.</data></camera_matrix>\n"
      "<distortion_coefficients type_id=\"opencv-matrix\"><rows>5</rows><cols>1</cols><dt>d</dt>"
      "<data>-0.2 0.05 0. 0. 0.</data></distortion_coefficients>\n</opencv_storage>\n";
  const std::string yaml =
      "%YAML:1.0\n---\nimage_width: 1280\nimage_height: 720\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n"
      "   dt: d\n   data: [300., 0., 640., 0., 310., 360., 0., 0., 1.]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [-0.2, 0.05, 0., 0., 0.]\n";
  const ImportResult import = imported_from(xml);
  EXPECT_EQ(to_json(import.calibration), to_json(imported_from(yaml).calibration));
  EXPECT_TRUE(import.notes.empty()) << all_notes(import);
  const auto head = *geometry::Head::make(import.calibration.heads.at(0));
  const auto pixel = head.project(geometry::Ray::towards(0.5, 0, 1));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 640.5 + 300 * 0.5 * (1 - 0.2 * 0.25 + 0.05 * 0.0625), 1e-9);
  for (const char* broken : {"<?xml version=\"1.0\"?><opencv_storage><image_width>", "<?xml version=\"1.0\"?><svg/>",
                             "<opencv_storage><a><_>1</_><b>2</b></a></opencv_storage>"}) {
    EXPECT_FALSE(import_project(broken, "rig")) << broken;
  }
}

const std::string kImage0 = "i w400 h300 f0 v100 r0 p0 y0 n\"h0.jpg\"\n";
const std::string kImage1 = "i w400 h300 f0 v=0 r0 p0 y60 n\"h1.jpg\"\n";
const std::string kImage2 = "i w400 h300 f0 v=1 r0 p0 y120 n\"h2.jpg\"\n";

TEST(KnownFields, ImagesThatAreDisabledInHugin_AreNoHeads) {
  const ImportResult import = imported_from(
      "# hugin project file\n#hugin_ptoversion 2\n#-hugin  cropFactor=1\n" + kImage0 +
      "#-hugin  cropFactor=1 disabled\n" + kImage1 + "#-hugin  cropFactor=1\n" + kImage2 +
      "c n0 N1 x1 y1 X1 Y1 t0\nc n0 N2 x1 y1 X1 Y1 t0\nk i1 t0 p\"0 0 90 0 90 90\"\nk i2 t0 p\"0 0 90 0 90 90\"\n");
  ASSERT_EQ(import.calibration.heads.size(), 2u);
  EXPECT_EQ(import.images, (std::vector<std::string>{"h0.jpg", "h2.jpg"}));
  EXPECT_NEAR(apart(import, 0, 1), 120, 1e-9);
  EXPECT_TRUE(says(import, "'h1.jpg' is disabled")) << all_notes(import);
  ASSERT_EQ(import.control_points.size(), 1u);
  EXPECT_EQ(import.control_points[0].head_b, 1u);
  EXPECT_TRUE(import.calibration.heads[0].region.masks.empty());
  EXPECT_EQ(import.calibration.heads[1].region.masks.size(), 1u);
  EXPECT_FALSE(import_project("#-hugin disabled\n" + kImage0, "rig"));
}

TEST(KnownFields, HuginsVignettingMode_DecidesWhetherItsNumbersCount) {
  const std::string image = "i w400 h300 f0 v100 Va1 Vb-0.2 Vc0 Vd0 n\"a.jpg\" ";
  EXPECT_NE(imported_from(image + "Vm5\n").calibration.heads[0].vignetting.coefficients[0], 0);
  EXPECT_EQ(imported_from(image + "Vm0\n").calibration.heads[0].vignetting.coefficients[0], 0);
  EXPECT_TRUE(says(imported_from(image + "Vm6 Vf\"flat.tif\"\n"), "flat field"));
  EXPECT_TRUE(says(imported_from(image + "Vm6 Vf\"flat.tif\"\n"), "flat.tif"));
}

std::string ptv(const std::string& input, const std::string& pano = "", const std::string& file = "") {
  const std::string plain =
      R"("width": 400, "height": 300, "proj": "rectilinear", "geometries": {"horizontalFocal": 167.8})";
  return "{" + file + "\"pano\": {" + pano + R"("inputs": [{"reader_config": "h0.jpg", )" + plain +
         R"(}, {"reader_config": "h1.jpg", )" + input + "}]}}";
}
const std::string kInput = R"("width": 400, "height": 300, "proj": "rectilinear", )";
const std::string kFocal = R"("geometries": {"yaw": 60, "horizontalFocal": 167.8})";

TEST(KnownFields, VideoStitchColours_BecomeGains) {
  // stitchEm multiplies light by 2^ev / red_corr; a head's gain is what it has too much of.
  const ImportResult import = imported_from(
      ptv(kInput + R"("red_corr": 1.5, "green_corr": [0, 0, 1.25], "blue_corr": 0.7, "ev": 1, )" + kFocal));
  const auto& one = import.calibration.heads.at(0).gain;
  const auto& two = import.calibration.heads.at(1).gain;
  EXPECT_NEAR(two[0] / one[0], 1.5 / 2, 1e-12);
  EXPECT_NEAR(two[1] / one[1], 1.25 / 2, 1e-12);
  EXPECT_NEAR(two[2] / one[2], 0.7 / 2, 1e-12);
  EXPECT_NEAR(one[1] * two[1], 1.25, 1e-12);
  EXPECT_TRUE(import.notes.empty()) << all_notes(import);
}

TEST(KnownFields, VideoStitchGammaAndVignetting_AreTheHeads) {
  const ImportResult import =
      imported_from(ptv(kInput + R"("response": "gamma", "gamma": 2.2, "vign_b": -0.3, "vign_x": 4, )" + kFocal));
  const HeadCalibration& head = import.calibration.heads.at(1);
  EXPECT_EQ(head.response.curve, Response::Curve::kGamma);
  EXPECT_EQ(head.response.gamma, 2.2);
  EXPECT_EQ(head.vignetting.coefficients[0], -0.3);
  EXPECT_EQ(head.vignetting.x, 204);
  EXPECT_EQ(head.vignetting.radius, 250);
  EXPECT_TRUE(
      says(imported_from(ptv(kInput + R"("response": "curve", "response_curve": [1], )" + kFocal)), "response_curve"));
}

TEST(KnownFields, VideoStitchsOldFieldsOfView_AreFocalLengths) {
  const double focal = 200 / std::tan(50 * kDegree);
  for (const char* input :
       {R"("geometries": {"yaw": 60, "hfov": 100})", R"("geometries": [0, 0, {"yaw": 60, "horizontalFov": 100}])",
        R"("hfov": 100, "yaw": 60, "lens_dist_b": 0)"}) {
    const ImportResult import = imported_from(ptv(kInput + input));
    ASSERT_EQ(import.calibration.heads.size(), 2u) << input;
    EXPECT_NEAR(std::get<RectilinearLens>(import.calibration.heads[1].lens).coefficients.at(0), focal, 1e-6) << input;
    EXPECT_NEAR(apart(import, 0, 1), 60, 1e-9);
    EXPECT_TRUE(import.notes.empty()) << all_notes(import);
  }
  // The focal length follows from the crop's width, by each projection's formula.
  const std::string fisheye =
      R"("width": 1000, "height": 800, "crop_left": 100, "crop_right": 900, "hfov": 180, "proj": )";
  const auto radius_at_a_radian = [&](const std::string& proj) {
    const ImportResult import = imported_from(ptv(fisheye + proj));
    const auto head = *geometry::Head::make(import.calibration.heads.at(1));
    return head.project(geometry::Ray::towards(std::sin(1.0), 0, std::cos(1.0)))->x - 500;
  };
  EXPECT_NEAR(radius_at_a_radian("\"ff_fisheye\""), 800 / std::numbers::pi, 1e-6);
  EXPECT_NEAR(radius_at_a_radian("\"circular_fisheye_opt\""), 400 / std::tan(45 * kDegree) * std::tan(0.5), 0.02);
}

TEST(KnownFields, VideoStitchTangentialDistortion_MovesPixels) {
  const ImportResult import =
      imported_from(ptv(R"("width": 400, "height": 300, "proj": "rectilinear", "useMeterDistortion": true,
              "geometries": {"horizontalFocal": 300, "distort_p1": 0.004, "distort_p2": -0.003})"));
  EXPECT_TRUE(says(import, "tangential")) << all_notes(import);
  const auto head = *geometry::Head::make(import.calibration.heads.at(1));
  double sum = 0;
  int count = 0;
  for (double x = -0.6; x <= 0.6; x += 0.1) {
    for (double y = -0.45; y <= 0.45; y += 0.1) {
      const double s = x * x + y * y;
      const double u = 200 + 300 * (x + 2 * 0.004 * x * y - 0.003 * (s + 2 * x * x));
      const double v = 150 + 300 * (y + 0.004 * (s + 2 * y * y) - 2 * 0.003 * x * y);
      const auto pixel = head.project(geometry::Ray::towards(x, y, 1));
      if (!pixel) continue;
      sum += (pixel->x - u) * (pixel->x - u) + (pixel->y - v) * (pixel->y - v);
      ++count;
    }
  }
  ASSERT_GT(count, 80);
  EXPECT_LT(std::sqrt(sum / count), 0.5);  // without the terms: 0.9 px
  EXPECT_FALSE(import_project(ptv(kInput + R"("geometries": {"horizontalFocal": 300, "distort_tau1": 0.1})"), "rig"));
}

TEST(KnownFields, FieldsThatNobodyKnows_AreNamed) {
  struct {
    std::string text, name;
  } const kFiles[] = {
      {ptv(kInput + R"("sparkle": 3, )" + kFocal), "'sparkle' (input of input 1)"},
      {ptv(kInput + kFocal, R"("glow": 1, )"), "'glow' (pano)"},
      {ptv(kInput + kFocal, "", R"("glitter": [1], )"), "'glitter' (file)"},
      {"i w100 h100 f0 v60 Qq7 n\"a.jpg\"\n", "'Qq' (i of head 'a')"},
      {"#-hugin shiny\ni w100 h100 f0 v60 n\"a.jpg\"\n", "'shiny' (#-hugin)"},
      {"Z w100\ni w100 h100 f0 v60 n\"a.jpg\"\n", "'Z' (file)"},
      {"#-imgfile 100 100 \"a.jpg\"\n#-sparkle 1\no f0 v60\n", "'sparkle' (#-)"},
      {"#-imgfile 100 100 \"a.jpg\"\no f0 v60 Qq7\n", "'Qq' (o of head 'a')"},
      {ros("sparkle: 1\n"), "'sparkle' (camera of head 'cam')"},
      {"cam0:\n  sparkle: 1\n" + kKalibrCamera, "'sparkle' (camera of cam0)"},
      {"imu0: 3\ncam0:\n" + kKalibrCamera, "'imu0' (chain)"},
  };
  for (const auto& [text, name] : kFiles) {
    const ImportResult import = imported_from(text);
    EXPECT_TRUE(says(import, "Not known to Nodal")) << text;
    EXPECT_TRUE(says(import, name)) << name << " is not in:\n" << all_notes(import);
  }
}

TEST(KnownFields, FieldsThatAreLeftOut_AreToldUnlessTheySayNothing) {
  struct {
    std::string loud, quiet, name;
  } const kFiles[] = {
      {ptv(kInput + R"("frame_offset": 7, )" + kFocal), ptv(kInput + R"("frame_offset": 0, )" + kFocal),
       "'frame_offset' = 7"},
      {ptv(kInput + R"("mask_data": "iVBO", )" + kFocal), ptv(kInput + R"("mask_data": "", )" + kFocal), "'mask_data'"},
      {ptv(kInput + R"("viewpoint_pan": 3.5, )" + kFocal),
       ptv(kInput + R"("viewpoint_model": "hugin", "viewpoint_pan": 0.0, )" + kFocal), "'viewpoint_pan'"},
      {ptv(kInput + kFocal, R"("red_corr": 1.2, )"),
       ptv(kInput + kFocal, R"("red_corr": 1, "stabilization": [1, 0, 0, 0], )"), "'red_corr' = 1.2"},
      {"i w100 h100 f0 v60 TrX0.1\n", "i w100 h100 f0 v60 TrX0.0 j3\n", "'TrX' = 0.1"},
      {"i w100 h100 f0 v60 n\"a\"\ni w100 h100 f0 v60 j=0 n\"b\"\n", "i w100 h100 f0 v60 j0\ni w100 h100 f0 v60 j0\n",
       "'j' = =0 of head 'b'"},
      {"#-imgfile 100 100 \"a.jpg\"\n#-imginactive 0\no f0 v60\n",
       "#-imgfile 100 100 \"a.jpg\"\n#-imginactive\n#-imgrotate44\no f0 v60\n", "switched off"},
      {ros("binning_x: 2\n"), ros("binning_x: 1\n"), "'binning_x' = 2"},
      {"cam0:\n  timeshift_cam_imu: 0.01\n" + kKalibrCamera,
       "cam0:\n  timeshift_cam_imu: 0.0\n  cam_overlaps: [1]\n" + kKalibrCamera, "'timeshift_cam_imu'"},
  };
  for (const auto& [loud, quiet, name] : kFiles) {
    EXPECT_TRUE(says(imported_from(loud), name)) << name << " is not in:\n" << all_notes(imported_from(loud));
    EXPECT_FALSE(says(imported_from(quiet), "eft out")) << quiet << "\n" << all_notes(imported_from(quiet));
  }
}

TEST(KnownFields, SeedsOfTheFuzzer_AreImportedByTheImporterThatTheyAreFor) {
  const std::filesystem::path folder = std::filesystem::path(NODAL_SOURCE_DIR) / "tests/fuzz/corpus/import";
  std::size_t seeds = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::ifstream in(entry.path());
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    const Result<ImportResult> import = import_project(text, "seed");
    EXPECT_TRUE(import) << entry.path() << ": " << (import ? "" : import.error().text());
    EXPECT_FALSE(import && says(*import, "Not known")) << entry.path();
    // Cut anywhere, it gives a result or one sentence.
    for (std::size_t length = 0; length < text.size(); length += 7) {
      const Result<ImportResult> cut = import_project(text.substr(0, length), "seed");
      EXPECT_TRUE(cut || !cut.error().message.empty()) << entry.path() << " cut at " << length;
    }
    ++seeds;
  }
  EXPECT_GE(seeds, 14u);
}

/// FIELDS.md by the code's tables.
std::string fields_page() {
  constexpr std::array kUses{"used", "noted", "refused", "not needed"};
  std::ostringstream page;
  page
      << "# Other programs' fields, and what an import does with them\n\n"
         "A field is *used*; or *noted*: it says something that Nodal cannot hold, and `nodal import` says so unless "
         "the "
         "value is one of\nthose that change nothing; or *refused*; or *not needed*: it is of the other program's own "
         "output, interface or sound. Any other\nfield is named as unknown. `*` at a name's end stands for any ending. "
         "These tables are the code's (`fields_*.cpp`); a test\ncompares them.\n";
  for (const KnownFormat* format : known_formats()) {
    page << "\n## " << format->program << "\n\nFrom " << format->specification << ".\n\n"
         << "| where | field | is | what it is | changes nothing |\n|---|---|---|---|---|\n";
    for (const KnownField& field : format->fields) {
      std::string neutral(field.neutral);
      std::ranges::replace(neutral, '|', ' ');
      page << "| " << field.place << " | `" << field.name << "` | " << kUses.at(static_cast<std::size_t>(field.use))
           << " | " << field.meaning << " | " << neutral << " |\n";
    }
  }
  return page.str();
}

TEST(KnownFields, FieldsPage_IsTheCodesTable) {
  const std::filesystem::path file = std::filesystem::path(NODAL_SOURCE_DIR) / "stitch/interchange/FIELDS.md";
  std::ifstream in(file);
  const std::string written{std::istreambuf_iterator<char>(in), {}};
  if (written == fields_page()) return;
  const std::string wanted = "FIELDS.md.wanted";
  std::ofstream(testing::TempDir() + wanted) << fields_page();
  ADD_FAILURE() << "FIELDS.md differs from the code's tables; what it must be is in " << testing::TempDir() + wanted;
}

}  // namespace
}  // namespace nodal::interchange
