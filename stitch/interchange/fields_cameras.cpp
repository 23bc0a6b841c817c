// The fields of Surround360, OpenCV, Kalibr and OCamCalib.
#include <array>

#include "stitch/interchange/known_fields.h"

namespace nodal::interchange {
namespace {

using enum FieldUse;

constexpr auto kSurround360 = std::to_array<KnownField>({
    {"rig", "cameras", kUsed, "the heads"},
    {"camera", "id", kUsed, "the head's name"},
    {"camera", "type", kUsed, "the lens: FTHETA, RECTILINEAR, EQUISOLID or ORTHOGRAPHIC"},
    {"camera", "resolution", kUsed, "the picture's size"},
    {"camera", "principal", kUsed, "the lens's centre"},
    {"camera", "focal", kUsed, "the focal lengths"},
    {"camera", "distortion", kUsed, "distortion"},
    {"camera", "fov", kUsed, "the angle up to which the lens is used"},
    {"camera", "origin", kUsed, "the head's position"},
    {"camera", "right", kUsed, "its attitude"},
    {"camera", "up", kUsed, "its attitude"},
    {"camera", "forward", kUsed, "its attitude"},
    {"camera", "version", kNoted, "a version of the format that is newer than Nodal knows", "1"},
    {"camera", "group", kUnneeded, "a name for several cameras"},
});

constexpr auto kOpenCv = std::to_array<KnownField>({
    {"camera", "image_width", kUsed, "the picture's width"},
    {"camera", "image_height", kUsed, "its height"},
    {"camera", "image_Width", kUsed, "the same, of OpenCV 2"},
    {"camera", "image_Height", kUsed, "the same, of OpenCV 2"},
    {"camera", "camera_matrix", kUsed, "focal lengths and centre"},
    {"camera", "Camera_Matrix", kUsed, "the same, of OpenCV 2"},
    {"camera", "distortion_coefficients", kUsed, "distortion"},
    {"camera", "Distortion_Coefficients", kUsed, "the same, of OpenCV 2"},
    {"camera", "dist_coeffs", kUsed, "the same"},
    {"camera", "fisheye_model", kUsed, "whether the lens is a fisheye"},
    {"camera", "distortion_model", kUsed, "the lens, of ROS: plumb_bob, rational_polynomial, equidistant, fisheye"},
    {"camera", "camera_model", kUsed, "the lens, of ROS's calibrator: pinhole or fisheye"},
    {"camera", "camera_name", kUsed, "the head's name"},
    {"camera", "rectification_matrix", kNoted,
     "how ROS turns the picture of a pair; place the heads with `nodal pairs`", "1 0 0 0 1 0 0 0 1"},
    {"camera", "binning_x", kNoted, "the picture's reduction; the numbers are for the whole one", "0|1"},
    {"camera", "binning_y", kNoted, "the picture's reduction; the numbers are for the whole one", "0|1"},
    {"camera", "roi", kNoted, "a part of the sensor; the numbers are for the whole one"},
    {"camera", "projection_matrix", kUnneeded, "the picture that ROS makes without distortion"},
    {"camera", "calibration_time", kUnneeded, "when it was calibrated"},
    {"camera", "calibration_Time", kUnneeded, "when it was calibrated"},
    {"camera", "nframes", kUnneeded, "how it was calibrated"},
    {"camera", "nr_of_frames", kUnneeded, "how it was calibrated"},
    {"camera", "nrOfFrames", kUnneeded, "how it was calibrated"},
    {"camera", "board_*", kUnneeded, "how it was calibrated"},
    {"camera", "square_*", kUnneeded, "how it was calibrated"},
    {"camera", "marker_size", kUnneeded, "how it was calibrated"},
    {"camera", "fix_aspect_ratio", kUnneeded, "how it was calibrated"},
    {"camera", "FixAspectRatio", kUnneeded, "how it was calibrated"},
    {"camera", "aspectRatio", kUnneeded, "how it was calibrated"},
    {"camera", "flags", kUnneeded, "how it was calibrated"},
    {"camera", "flagValue", kUnneeded, "how it was calibrated"},
    {"camera", "avg_reprojection_error", kUnneeded, "how well it was calibrated"},
    {"camera", "Avg_Reprojection_Error", kUnneeded, "how well it was calibrated"},
    {"camera", "per_view_reprojection_errors", kUnneeded, "how well it was calibrated"},
    {"camera", "Per_View_Reprojection_Errors", kUnneeded, "how well it was calibrated"},
    {"camera", "extrinsic_parameters", kUnneeded, "where the boards were"},
    {"camera", "Extrinsic_Parameters", kUnneeded, "where the boards were"},
    {"camera", "grid_points", kUnneeded, "the board's points"},
    {"camera", "image_points", kUnneeded, "the board's points in the pictures"},
    {"camera", "Image_points", kUnneeded, "the board's points in the pictures"},
    {"matrix", "data", kUsed, "its numbers"},
    {"matrix", "rows", kUnneeded, "its size, which its use fixes"},
    {"matrix", "cols", kUnneeded, "its size, which its use fixes"},
    {"matrix", "dt", kUnneeded, "the numbers' type"},
    {"matrix", "type_id", kUnneeded, "that it is a matrix"},
});

constexpr auto kKalibr = std::to_array<KnownField>({
    {"chain", "camN", kUsed, "a camera; they are counted from cam0 without a gap"},
    {"camera", "camera_model", kUsed, "the projection: pinhole, omni, eucm or ds"},
    {"camera", "intrinsics", kUsed, "the projection's numbers"},
    {"camera", "distortion_model", kUsed, "the distortion: radtan, equidistant, fov or none"},
    {"camera", "distortion_coeffs", kUsed, "its numbers"},
    {"camera", "resolution", kUsed, "the picture's size"},
    {"camera", "rostopic", kUsed, "the head's name"},
    {"camera", "T_cn_cnm1", kUsed, "its place by the camera before it"},
    {"camera", "T_cam_imu", kUsed, "its place by the inertial sensor, where there is no T_cn_cnm1"},
    {"camera", "T_imu_cam", kUsed, "the inverse, of OpenVINS"},
    {"camera", "timeshift_cam_imu", kNoted, "the delay of its pictures against the inertial sensor", "0"},
    {"camera", "line_delay", kNoted, "a rolling shutter", "0"},
    {"camera", "cam_overlaps", kUnneeded, "which cameras see the same things"},
});

constexpr auto kOcam = std::to_array<KnownField>({
    {"line of numbers", "1", kUsed, "the polynomial from the picture to rays"},
    {"line of numbers", "2", kUnneeded, "its inverse"},
    {"line of numbers", "3", kUsed, "the centre"},
    {"line of numbers", "4", kUsed, "the affine parameters c, d and e"},
    {"line of numbers", "5", kUsed, "the picture's height and width"},
});

}  // namespace

const KnownFormat& surround360_fields() {
  static const KnownFormat kFormat{"Surround360", "the camera class of Surround360 and facebook360_dep", kSurround360};
  return kFormat;
}

const KnownFormat& opencv_fields() {
  static const KnownFormat kFormat{"OpenCV", "OpenCV's calibration programs, 2 to 4, and ROS's camera_calibration",
                                   kOpenCv};
  return kFormat;
}

const KnownFormat& kalibr_fields() {
  static const KnownFormat kFormat{"Kalibr", "Kalibr's camchain.yaml, and OpenVINS's", kKalibr};
  return kFormat;
}

const KnownFormat& ocam_fields() {
  static const KnownFormat kFormat{"OCamCalib", "calib_results.txt as the toolbox exports it", kOcam};
  return kFormat;
}

}  // namespace nodal::interchange
