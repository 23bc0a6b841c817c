// A field that a format's table calls used changes the result: for each one, a file in which it stands, and what to
// change.
#include <gtest/gtest.h>

#include <array>
#include <set>
#include <string>
#include <vector>

#include "stitch/interchange/import.h"
#include "stitch/interchange/known_fields.h"

namespace nodal::interchange {
namespace {

struct Change {
  std::string place, name;
  std::string from, to;  ///< the first occurrence in the format's file
};

struct Sample {
  const KnownFormat& format;
  std::string file;
  std::vector<Change> changes;
};

/// All that an import gives, as text.
std::string outcome_of(const std::string& file) {
  const Result<ImportResult> import = import_project(file, "rig");
  if (!import) return import.error().text();
  std::string text = to_json(import->calibration);
  for (const std::string& image : import->images) text += image + "\n";
  for (const std::string& note : import->notes) text += note + "\n";
  for (const ControlPoint& p : import->control_points) {
    text += std::to_string(p.head_a) + " " + std::to_string(p.pixel_a.x) + " " + std::to_string(p.pixel_a.y) + " " +
            std::to_string(p.head_b) + " " + std::to_string(p.pixel_b.x) + " " + std::to_string(p.pixel_b.y) + "\n";
  }
  return text;
}

void expect_all_used(const Sample& sample) {
  const std::string before = outcome_of(sample.file);
  ASSERT_TRUE(import_project(sample.file, "rig")) << before;
  std::set<std::pair<std::string, std::string>> changed;
  for (const Change& change : sample.changes) {
    changed.emplace(change.place, change.name);
    std::string file = sample.file;
    const std::size_t at = file.find(change.from);
    ASSERT_NE(at, std::string::npos) << change.from;
    file.replace(at, change.from.size(), change.to);
    EXPECT_NE(outcome_of(file), before) << change.place << " " << change.name << ": " << change.from << " to "
                                        << change.to;
  }
  for (const KnownField& field : sample.format.fields) {
    if (field.use != FieldUse::kUsed) continue;
    EXPECT_TRUE(changed.contains({std::string(field.place), std::string(field.name)}))
        << sample.format.program << ": nothing shows that " << field.place << " " << field.name << " is used";
  }
}

TEST(UsedFields, OfHugin_ChangeTheResult) {
  expect_all_used(
      {hugin_fields(),
       "# hugin project file\n#-hugin cropFactor=1\n"
       "i w800 h600 f3 v100 a0.01 b0.02 c0.03 d4 e5 y6 p7 r8 S10,790,5,590 Eev3 Er1.1 Eb0.9 Ra0 Rb0 Rc0 Rd0 Re0 Va1 "
       "Vb-0.1 Vc0.01 Vd0.02 Vx3 Vy4 Vm5 n\"a.jpg\"\n#-hugin cropFactor=2\ni w800 h600 f0 v90 y60 n\"b.jpg\"\n"
       "c n0 N1 x10 y20 X30 Y40 t0\nk i0 t0 p\"1 1 50 1 50 50\"\n",
       {{"file", "i", "i w800 h600 f0 v90 y60 n\"b.jpg\"\n", ""},
        {"file", "c", "c n0 N1 x10 y20 X30 Y40 t0\n", ""},
        {"file", "k", "k i0 t0 p\"1 1 50 1 50 50\"\n", ""},
        {"#-hugin", "disabled", "cropFactor=2", "cropFactor=2 disabled"},
        {"i", "w", "w800", "w810"},
        {"i", "h", "h600", "h610"},
        {"i", "n", "n\"a.jpg\"", "n\"c.jpg\""},
        {"i", "f", "f3", "f2"},
        {"i", "v", "v100", "v101"},
        {"i", "a", "a0.01", "a0.02"},
        {"i", "b", "b0.02", "b0.01"},
        {"i", "c", "c0.03", "c0.02"},
        {"i", "d", "d4", "d5"},
        {"i", "e", "e5", "e4"},
        {"i", "y", "y6 ", "y7 "},
        {"i", "p", "p7 ", "p6 "},
        {"i", "r", "r8 ", "r7 "},
        {"i", "S", "S10,", "S20,"},
        {"i", "Eev", "Eev3", "Eev4"},
        {"i", "Er", "Er1.1", "Er1.2"},
        {"i", "Eb", "Eb0.9", "Eb0.8"},
        {"i", "Ra", "Ra0", "Ra1"},
        {"i", "Rb", "Rb0", "Rb1"},
        {"i", "Rc", "Rc0", "Rc1"},
        {"i", "Rd", "Rd0", "Rd1"},
        {"i", "Re", "Re0", "Re1"},
        {"i", "Va", "Va1", "Va1.1"},
        {"i", "Vb", "Vb-0.1", "Vb-0.2"},
        {"i", "Vc", "Vc0.01", "Vc0.02"},
        {"i", "Vd", "Vd0.02", "Vd0.01"},
        {"i", "Vx", "Vx3", "Vx4"},
        {"i", "Vy", "Vy4", "Vy3"},
        {"i", "Vm", "Vm5", "Vm0"},
        {"c", "n", "c n0", "c n1"},
        {"c", "N", "N1", "N0"},
        {"c", "x", "x10", "x11"},
        {"c", "y", "y20", "y21"},
        {"c", "X", "X30", "X31"},
        {"c", "Y", "Y40", "Y41"},
        {"k", "i", "k i0", "k i1"},
        {"k", "t", "t0 p", "t1 p"},
        {"k", "p", "50 50", "60 60"}}});
}

TEST(UsedFields, OfPtGui_ChangeTheResult) {
  expect_all_used(
      {ptgui_fields(),
       "#-dummyimage\no w1 h1 f3 v120\n#-imgfile 800 600 \"a.jpg\"\n"
       "o f3 v100 a0.01 b0.02 c0.03 d4 e5 y6 p7 r8 C10,790,5,590\n#-imgfile 800 600 \"b.jpg\"\no f3 v=0 y60\n"
       "c n1 N2 x10 y20 X30 Y40 t0\n",
       {{"file", "o", "o f3 v=0 y60\n", ""},
        {"file", "c", "c n1 N2 x10 y20 X30 Y40 t0\n", ""},
        {"#-", "imgfile", "#-imgfile 800", "#-imgfile 810"},
        {"#-", "dummyimage", "#-dummyimage\n", ""},
        {"o", "f", "o f3 v100", "o f2 v100"},
        {"o", "v", "v100", "v101"},
        {"o", "a", "a0.01", "a0.02"},
        {"o", "b", "b0.02", "b0.01"},
        {"o", "c", "c0.03", "c0.02"},
        {"o", "d", "d4", "d5"},
        {"o", "e", "e5", "e4"},
        {"o", "y", "y6 ", "y7 "},
        {"o", "p", "p7 ", "p6 "},
        {"o", "r", "r8 ", "r7 "},
        {"o", "C", "C10,", "C20,"},
        {"c", "n", "c n1", "c n2"},
        {"c", "N", "N2", "N1"},
        {"c", "x", "x10", "x11"},
        {"c", "y", "y20", "y21"},
        {"c", "X", "X30", "X31"},
        {"c", "Y", "Y40", "Y41"}}});
}

/// An input with 'geometries', one of an old project, and one with fields of view.
const std::string kVideoStitch = R"({"pano": {"global_orientation": [1, 0, 0, 0], "spherescale": 2, "inputs": [
{"width": 400, "height": 300, "reader_config": "a.jpg", "proj": "ff_fisheye", "video_enabled": true, "enabled": true,
 "crop_left": 0, "crop_right": 400, "crop_top": 0, "crop_bottom": 300, "useMeterDistortion": true, "ev": 0.1,
 "red_corr": 1.1, "green_corr": 1.05, "blue_corr": 0.9, "response": "gamma", "gamma": 2.2, "vign_a": 1, "vign_b": -0.1,
 "vign_c": 0.01, "vign_d": 0.02, "vign_x": 1, "vign_y": 2, "geometries": {"yaw": 3, "pitch": 4, "roll": 5,
 "center_x": 6, "center_y": 7, "distort_a": 0.01, "distort_b": 0.011, "distort_c": 0.012, "distort_p1": 0.0013,
 "distort_p2": 0.0014, "distort_s1": 0.0015, "distort_s2": 0.0016, "distort_s3": 0.0017, "distort_s4": 0.0018,
 "horizontalFocal": 167, "verticalFocal": 168, "translation_x": 0.1, "translation_y": 0.11, "translation_z": 0.12}},
{"width": 401, "height": 301, "filename": "b.jpg", "proj": "ff_fisheye", "hfov": 102, "yaw": 31, "pitch": 32,
 "roll": 33, "lens_dist_a": 0.021, "lens_dist_b": 0.022, "lens_dist_c": 0.023,
 "dist_center_x": 34, "dist_center_y": 35},
{"width": 402, "height": 302, "proj": "ff_fisheye", "geometries": {"horizontalFov": 103}},
{"width": 403, "height": 303, "proj": "ff_fisheye", "geometries": {"hfov": 104}}],
"calibration_control_points": {"matched_control_points": [
 {"input_index0": 0, "x0": 1, "y0": 2, "input_index1": 1, "x1": 3, "y1": 4}]}}})";

TEST(UsedFields, OfVideoStitch_ChangeTheResult) {
  std::vector<Change> changes{{"file", "pano", "\"pano\"", "\"panorama\""},
                              {"pano", "inputs", "\"inputs\"", "\"input\""},
                              {"pano", "calibration_control_points", "\"x0\": 1", "\"x0\": 2"},
                              {"pano", "global_orientation", "[1, 0, 0, 0]", "[1, 0.1, 0, 0]"},
                              {"input", "geometries", "\"geometries\"", "\"geometry\""},
                              {"input", "reader_config", "a.jpg", "c.jpg"},
                              {"input", "filename", "b.jpg", "c.jpg"},
                              {"input", "proj", "ff_fisheye", "circular_fisheye"},
                              {"input", "video_enabled", "\"video_enabled\": true", "\"video_enabled\": false"},
                              {"input", "enabled", "\"enabled\": true", "\"enabled\": false"},
                              {"input", "useMeterDistortion", "Distortion\": true", "Distortion\": false"},
                              {"input", "response", "\"gamma\", ", "\"linear\", "}};
  const auto number = [&](const std::string& place, const std::string& name, const std::string& from,
                          const std::string& to) {
    changes.push_back({place, name, "\"" + name + "\": " + from, "\"" + name + "\": " + to});
  };
  number("pano", "spherescale", "2", "3");
  for (const auto& [name, from, to] : std::vector<std::array<std::string, 3>>{{"width", "400", "410"},
                                                                              {"height", "300", "310"},
                                                                              {"crop_left", "0", "9"},
                                                                              {"crop_right", "400", "390"},
                                                                              {"crop_top", "0", "9"},
                                                                              {"crop_bottom", "300", "290"},
                                                                              {"ev", "0.1", "0.2"},
                                                                              {"red_corr", "1.1", "1.2"},
                                                                              {"green_corr", "1.05", "1.2"},
                                                                              {"blue_corr", "0.9", "0.8"},
                                                                              {"gamma", "2.2", "2"},
                                                                              {"vign_a", "1", "1.2"},
                                                                              {"vign_b", "-0.1", "-0.2"},
                                                                              {"vign_c", "0.01", "0.02"},
                                                                              {"vign_d", "0.02", "0.01"},
                                                                              {"vign_x", "1", "3"},
                                                                              {"vign_y", "2", "3"},
                                                                              {"hfov", "102", "101"},
                                                                              {"yaw", "31", "30"},
                                                                              {"pitch", "32", "30"},
                                                                              {"roll", "33", "30"},
                                                                              {"lens_dist_a", "0.021", "0.02"},
                                                                              {"lens_dist_b", "0.022", "0.02"},
                                                                              {"lens_dist_c", "0.023", "0.02"},
                                                                              {"dist_center_x", "34", "30"},
                                                                              {"dist_center_y", "35", "30"}}) {
    number("input", name, from, to);
  }
  for (const auto& [name, from, to] : std::vector<std::array<std::string, 3>>{{"yaw", "3", "2"},
                                                                              {"pitch", "4", "2"},
                                                                              {"roll", "5", "2"},
                                                                              {"center_x", "6", "2"},
                                                                              {"center_y", "7", "2"},
                                                                              {"distort_a", "0.01", "0.02"},
                                                                              {"distort_b", "0.011", "0.02"},
                                                                              {"distort_c", "0.012", "0.02"},
                                                                              {"distort_p1", "0.0013", "0.002"},
                                                                              {"distort_p2", "0.0014", "0.1"},
                                                                              {"distort_s1", "0.0015", "0.1"},
                                                                              {"distort_s2", "0.0016", "0.1"},
                                                                              {"distort_s3", "0.0017", "0.1"},
                                                                              {"distort_s4", "0.0018", "0.1"},
                                                                              {"horizontalFocal", "167", "160"},
                                                                              {"verticalFocal", "168", "160"},
                                                                              {"horizontalFov", "103", "100"},
                                                                              {"hfov", "104", "100"},
                                                                              {"translation_x", "0.1", "0.2"},
                                                                              {"translation_y", "0.11", "0.2"},
                                                                              {"translation_z", "0.12", "0.2"}}) {
    number("geometry", name, from, to);
  }
  expect_all_used({videostitch_fields(), kVideoStitch, changes});
}

TEST(UsedFields, OfSurround360_ChangeTheResult) {
  expect_all_used(
      {surround360_fields(),
       R"({"cameras": [{"version": 1, "id": "cam0", "type": "FTHETA", "resolution": [800, 600], "principal": [400, 300],
"focal": [300, -300], "distortion": [0.01, 0.02], "fov": 0.7, "origin": [0.1, 0, 0], "forward": [1, 0, 0],
"up": [0, 0, 1], "right": [0, -1, 0]}]})",
       {{"rig", "cameras", "\"cameras\"", "\"camera\""},
        {"camera", "id", "cam0", "cam1"},
        {"camera", "type", "FTHETA", "RECTILINEAR"},
        {"camera", "resolution", "[800", "[810"},
        {"camera", "principal", "[400", "[410"},
        {"camera", "focal", "[300, -300]", "[310, -310]"},
        {"camera", "distortion", "0.02]", "0.03]"},
        {"camera", "fov", "0.7", "0.8"},
        {"camera", "origin", "[0.1", "[0.2"},
        {"camera", "forward", "[1, 0, 0]", "[0, 1, 0]"},
        {"camera", "up", "[0, 0, 1]", "[0, 1, 0]"},
        {"camera", "right", "[0, -1, 0]", "[0, 1, 0]"}}});
}

std::string opencv_file(bool old) {
  const std::string matrix = old ? "Camera_Matrix" : "camera_matrix";
  const std::string distortion = old ? "Distortion_Coefficients" : "distortion_coefficients";
  return std::string("%YAML:1.0\n---\n") + (old ? "image_Width: 640\nimage_Height" : "image_width: 640\nimage_height") +
         ": 480\ncamera_name: left\nfisheye_model: 0\ncamera_model: pinhole\ndistortion_model: plumb_bob\n" + matrix +
         ":\n   rows: 3\n   data: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n" + distortion +
         ":\n   data: [-0.2, 0.05, 0, 0]\n";
}

TEST(UsedFields, OfOpenCv_ChangeTheResult) {
  const std::vector<Change> changes{
      {"camera", "image_width", "image_width: 640", "image_width: 650"},
      {"camera", "image_height", ": 480", ": 490"},
      {"camera", "camera_matrix", "[500", "[510"},
      {"camera", "distortion_coefficients", "[-0.2", "[-0.1"},
      {"camera", "dist_coeffs", "distortion_coefficients:\n   data: [-0.2", "dist_coeffs:\n   data: [-0.1"},
      {"camera", "camera_name", "left", "right"},
      {"camera", "fisheye_model", "fisheye_model: 0\ncamera_model: pinhole\ndistortion_model: plumb_bob",
       "fisheye_model: 1"},
      {"camera", "camera_model", "camera_model: pinhole\ndistortion_model: plumb_bob", "camera_model: fisheye"},
      {"camera", "distortion_model", "plumb_bob", "equidistant"},
      {"matrix", "data", "data", "date"},
      {"camera", "image_Width", "image_width", "image_Widths"},
      {"camera", "image_Height", "image_height", "image_Heights"},
      {"camera", "Camera_Matrix", "camera_matrix", "Camera_Matrixs"},
      {"camera", "Distortion_Coefficients", "distortion_coefficients", "Distortion_Coefficient"}};
  expect_all_used({opencv_fields(), opencv_file(false), changes});
  // The names of OpenCV 2 give what those of later versions give.
  EXPECT_EQ(outcome_of(opencv_file(true)), outcome_of(opencv_file(false)));
}

TEST(UsedFields, OfKalibr_ChangeTheResult) {
  const std::string camera =
      "  camera_model: pinhole\n  intrinsics: [190, 190, 255, 256]\n  distortion_model: equidistant\n"
      "  distortion_coeffs: [0.003, 0, 0, 0]\n  resolution: [512, 512]\n";
  const std::string step = ": [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
  const std::string turned = ": [[0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0.3], [0, 0, 0, 1]]\n";
  expect_all_used({kalibr_fields(),
                   "cam0:\n  rostopic: /left/image_raw\n  T_cam_imu" + step + camera + "cam1:\n  T_cn_cnm1" + step +
                       camera + "cam2:\n  T_cam_imu" + turned + camera + "cam3:\n  T_imu_cam" + turned + camera,
                   {{"chain", "camN", "cam3", "cam4"},
                    {"camera", "camera_model", "pinhole", "omni"},
                    {"camera", "intrinsics", "[190", "[200"},
                    {"camera", "distortion_model", "equidistant", "radtan"},
                    {"camera", "distortion_coeffs", "0.003", "0.004"},
                    {"camera", "resolution", "[512", "[513"},
                    {"camera", "rostopic", "left", "right"},
                    {"camera", "T_cn_cnm1", "T_cn_cnm1: [[1, 0, 0, 0.1]", "T_cn_cnm1: [[1, 0, 0, 0.2]"},
                    {"camera", "T_cam_imu", "T_cam_imu: [[1, 0, 0, 0.1]", "T_cam_imu: [[1, 0, 0, 0.2]"},
                    {"camera", "T_imu_cam", "T_imu_cam: [[0, 0, -1, 0]", "T_imu_cam: [[0, 0, -1, 0.1]"}}});
}

TEST(UsedFields, OfOCamCalib_ChangeTheResult) {
  expect_all_used({ocam_fields(),
                   "#polynomial coefficients (ocam_model)\n5 -300.0 0.0 0.0005 0.0000001 0.0000000001\n"
                   "#inverse\n3 1.0 2.0 3.0\n#centre\n300.5 400.25\n#affine\n1.0 0.0001 0.0002\n#size\n600 800\n",
                   {{"line of numbers", "1", "-300.0", "-310.0"},
                    {"line of numbers", "3", "300.5", "301.5"},
                    {"line of numbers", "4", "1.0 0.0001", "1.01 0.0001"},
                    {"line of numbers", "5", "600 800", "600 810"}}});
}

}  // namespace
}  // namespace nodal::interchange
