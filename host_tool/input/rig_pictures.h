// A rig's calibration together with the pictures that its heads took.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/input/nominal_rig.h"
#include "host_tool/input/pictures.h"
#include "host_tool/input/project_pictures.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/registration.h"

namespace nodal::autocalibration {
struct Match;
}

namespace nodal::host {

/// A range of distances from the lens's axis in the first placed picture.
struct LensRange {
  double from_px = 0, to_px = 0;
  double from_deg = 0, to_deg = 0;  ///< angles of the rays, with the lens that was found
};

/// Where points determine the lens.
struct FoundLens {
  std::string family;  ///< what is assumed of the lens elsewhere: "equidistant"; empty: nothing
  LensRange seen;      ///< where there are points
  LensRange known;     ///< where they determine the lens to 2 %; empty: nowhere
  double unsure = 0;   ///< how wrong it may be elsewhere, part of the distance from the axis
  bool mostly = true;  ///< known over most of the radius
  bool whole = true;   ///< known everywhere
  std::string note;    ///< what of it is assumed, in whole sentences; empty: nothing

  double may_be_wrong_percent() const;  ///< `unsure`, rounded up
};

/// How a calibration was found in the pictures of one set.
struct PointMatch {
  std::size_t set = 0;
  std::string confidence;             ///< one sentence: how many pictures were placed, by what, and how well they agree
  std::size_t placed = 0, given = 0;  ///< numbers of pictures
  std::size_t point_count = 0;        ///< points that agree, each in two pictures
  double median_px = 0;               ///< how well they agree
  std::shared_ptr<const std::vector<autocalibration::Match>> points;  ///< those that agree, between placed pictures
  FoundLens lens;
};

/// Pictures of one rig, set by set. Files are decoded when they are needed, and their pixels are kept until they are
/// taken or released.
///
/// Threading: thread-bound.
/// Ownership: owns the pixels that are decoded; frames() refers to them.
struct RigPictures {
  /// Where the calibration is from.
  enum class Origin : std::uint8_t { kCalibration, kProject, kDataSheet, kPictures, kRig };

  Origin origin = Origin::kCalibration;
  Calibration calibration;                     ///< has no heads with kPictures before calibrate_by_pictures()
  std::vector<std::string> heads;              ///< the heads' names, in the order of every set
  std::vector<std::vector<HeadPicture>> sets;  ///< one picture per head in each set
  std::vector<std::string> notes;              ///< whole sentences for the user
  std::optional<PointMatch> match;             ///< only with kPictures, after calibrate_by_pictures()

  /// The files of every set; empty names for a running rig's.
  std::vector<std::vector<std::string>> files() const;
  /// One set, which is decoded, as a registration takes it.
  registration::FrameSet frames(std::size_t set) const;
  /// All of them.
  std::vector<registration::FrameSet> frames() const;
};

/// The files of the pictures, one per head and set. The arguments are either pictures, in the calibration's order, set
/// after set; or folders with one picture per head, named after the head (cam0.png); or one folder per head, named
/// after it, with a sequence of pictures. `names`: the heads' names.
/// Errors: kBadValue with what is missing or superfluous; kNotFound for a folder without a head's picture.
Result<std::vector<std::vector<std::string>>> picture_files(const std::vector<std::string>& arguments,
                                                            const std::vector<std::string>& names);

/// What several folders are taken for, in words.
std::string folder_per_head(std::size_t folders, std::size_t sets);
std::string folder_per_set(std::size_t folders, std::size_t heads);

/// What the user says of the files besides their names.
struct FileOptions {
  PicturePlaces places = PicturePlaces::kBesideProject;
  SplitChoice split{};
  int take_sets = 3;  ///< sets that are used of a take or of films, at most
};

/// How many pictures each of the files has that a command names: as the user says, or two circles in a single file.
/// `arguments`: pictures or folders. Errors: those of reading the file.
Result<PictureSplit> split_of(const std::vector<std::string>& arguments, const SplitChoice& choice);

/// The sets of files that have the pictures of all heads; of a folder, its pictures.
/// Errors: kBadValue if the heads are not as many as the pictures in a file; those of pictures_in().
Result<std::vector<std::vector<HeadPicture>>> split_pictures(const std::vector<std::string>& arguments,
                                                             const PictureSplit& split, std::size_t heads);

/// `arguments`: with `nominal`, pictures of that rig, of which the first set is decoded (folders hold cam0.png,
/// cam1.png and so on); else a calibration in any format, then pictures as for picture_files(), or the folder of a
/// take, of which `options.take_sets` sets are used. A project that names its pictures needs no further ones: their
/// paths are relative to the project's folder, and `options` say where they may be.
/// Errors: those of read_calibration_file(), of nominal_rig(), of project_pictures() and of picture_files(), with the
///   file or the option; those of reading pictures; kMissingField without pictures.
Result<RigPictures> read_rig_pictures(const NominalWords& nominal, const std::vector<std::string>& arguments,
                                      const FileOptions& options = {});

/// The same with every set decoded, for computations that need all pictures at once. Heads with a linear response keep
/// linear numbers if the calibration's response is known: that of a data sheet is not.
Result<RigPictures> read_all_pictures(const NominalWords& nominal, const std::vector<std::string>& arguments,
                                      const FileOptions& options = {});

/// The same pictures with the calibration that a data sheet describes; heads keep their names.
/// Errors: kBadValue if it has another number of heads; those of nominal_rig().
Result<RigPictures> by_data_sheet(RigPictures rig, const NominalWords& words);

/// Decodes a set and moves its pictures out, all in one pixel format: I420 if every file is 4:2:0, GREY if every one is
/// grey, else RGB24. With `rgb`: always RGB24. Linear numbers stay so for heads with a linear response.
/// Errors: those of decode_all(); kHeadMismatch, with the file and the head, for a picture whose size differs from its
/// head's.
Result<std::vector<DecodedImage>> take_set(RigPictures& rig, std::size_t set, bool rgb);

}  // namespace nodal::host
