#include "host_tool/input/rig_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <utility>

#include "host_tool/console/quantities.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/input/film_pictures.h"
#include "host_tool/input/picture_folders.h"
#include "host_tool/input/picture_masks.h"
#include "host_tool/input/take_heads.h"
#include "host_tool/input/take_pictures.h"
#include "protocol/base/try.h"
#include "stitch/media/picture_folder.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

std::string folder_name(const std::string& folder) {
  const fs::path path = fs::path(folder).lexically_normal();
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

// The picture of a head in a folder: the file with the head's name.
Result<std::string> picture_of(const fs::path& folder, const std::string& head) {
  std::vector<std::string> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (media::named_like_a_picture(entry.path().string()) && entry.path().stem() == head) {
      found.push_back(entry.path().string());
    }
  }
  if (error) return fail(Errc::kIo, folder.string() + ": " + error.message());
  if (found.empty()) {
    return fail(Errc::kNotFound,
                fmt::format("{}: no picture of head '{}' ({}.png or {}.jpg)", folder.string(), head, head, head));
  }
  if (found.size() > 1) {
    return fail(Errc::kBadValue, fmt::format("{}: two pictures of head '{}'; leave one", folder.string(), head));
  }
  return found.front();
}

/// Whether the arguments are a folder for each head, called after it.
bool are_sequences(const std::vector<std::string>& arguments, const std::vector<std::string>& names) {
  const auto is_folder = [](const std::string& name) {
    std::error_code error;
    return fs::is_directory(name, error);
  };
  const auto named = [&](const std::string& name) {
    return std::ranges::find(arguments, name, folder_name) != arguments.end();
  };
  return arguments.size() == names.size() && std::ranges::all_of(arguments, is_folder) &&
         std::ranges::all_of(names, named);
}

// Folders called after the heads hold a sequence each: the n-th pictures, sorted by name, are a set.
Result<std::vector<std::vector<std::string>>> sequences_of(const std::vector<std::string>& folders,
                                                           const std::vector<std::string>& names) {
  std::vector<std::vector<std::string>> sets;
  for (std::size_t h = 0; h < names.size(); ++h) {
    const auto own = std::ranges::find(folders, names[h], folder_name);
    NODAL_TRY_ASSIGN(const PictureFolder inside, sequence_in(*own));
    const std::vector<std::string>& pictures = inside.files;
    if (h == 0) sets.resize(pictures.size());
    if (pictures.size() != sets.size()) {
      return fail(Errc::kBadValue,
                  fmt::format("{} has {} pictures, and {} has {}; every head needs one for each set", *own,
                              pictures.size(), *std::ranges::find(folders, names[0], folder_name), sets.size()));
    }
    for (std::size_t n = 0; n < sets.size(); ++n) sets[n].push_back(pictures[n]);
  }
  return sets;
}

std::vector<std::string> names_of(const Calibration& calibration) {
  std::vector<std::string> names;
  for (const HeadCalibration& head : calibration.heads) names.push_back(head.name);
  return names;
}

/// One file may hold the pictures of several heads, side by side; two files with the same bytes are a mistake.
void tell_copies(const std::vector<std::string>& files, std::vector<std::string>& notes) {
  for (const auto& [later, earlier] : same_files(files)) {
    std::error_code error;
    if (fs::equivalent(files[later], files[earlier], error)) continue;
    notes.push_back(fmt::format("{} and {} are the same picture, for two heads", files[later], files[earlier]));
  }
}

PixelFormat common_format(const std::vector<DecodedImage>& pictures, bool rgb) {
  const auto all = [&](PixelFormat format) {
    return std::ranges::all_of(pictures, [format](const DecodedImage& picture) { return picture.format == format; });
  };
  if (rgb) return PixelFormat::kRgb24;
  return all(PixelFormat::kI420)    ? PixelFormat::kI420
         : all(PixelFormat::kGrey8) ? PixelFormat::kGrey8
                                    : PixelFormat::kRgb24;
}

std::vector<std::vector<HeadPicture>> pictures_of(const std::vector<std::vector<std::string>>& files) {
  std::vector<std::vector<HeadPicture>> sets;
  for (const std::vector<std::string>& set : files) {
    sets.emplace_back();
    for (const std::string& file : set) sets.back().emplace_back(file);
  }
  return sets;
}

/// Pictures of a take, in the order of the calibration's heads.
Result<std::vector<std::vector<HeadPicture>>> sets_of_take(const std::string& folder,
                                                           const std::vector<std::string>& heads, int count) {
  NODAL_TRY_ASSIGN(RigPictures take, take_pictures(folder, count));
  std::vector<std::vector<HeadPicture>> sets;
  for (std::vector<HeadPicture>& set : take.sets) {
    sets.emplace_back();
    for (const std::string& head : heads) {
      const auto place = std::ranges::find(take.heads, head);
      if (place == take.heads.end()) {
        return fail(Errc::kHeadMismatch, fmt::format("{}: the take has no head '{}'", folder, head));
      }
      sets.back().push_back(std::move(set[static_cast<std::size_t>(place - take.heads.begin())]));
    }
  }
  return sets;
}

/// The pictures that arguments name, for heads that are known.
Result<std::vector<std::vector<HeadPicture>>> sets_of(const std::vector<std::string>& arguments,
                                                      const FileOptions& options, const std::vector<std::string>& heads,
                                                      std::vector<std::string>& notes) {
  if (are_films(arguments)) {
    if (arguments.size() == heads.size()) return film_pictures(arguments, options.take_sets, notes);
    return fail(Errc::kHeadMismatch, fmt::format("{} films for {} heads; give one for each head, in the calibration's "
                                                 "order",
                                                 arguments.size(), heads.size()));
  }
  NODAL_TRY_ASSIGN(const PictureSplit split, split_of(arguments, options.split));
  if (split.count() > 1) return split_pictures(arguments, split, heads.size());
  NODAL_TRY_ASSIGN(const auto files, picture_files(arguments, heads));
  std::error_code error;
  if (arguments.size() > 1 && fs::is_directory(arguments.front(), error)) {
    notes.push_back(are_sequences(arguments, heads) ? folder_per_head(arguments.size(), files.size())
                                                    : folder_per_set(arguments.size(), heads.size()));
  }
  if (!files.empty()) tell_copies(files.front(), notes);
  return pictures_of(files);
}

/// `arguments`: pictures of a rig by its data sheet.
Result<RigPictures> read_nominal_pictures(const NominalWords& words, const std::vector<std::string>& given,
                                          const FileOptions& options) {
  NODAL_TRY_ASSIGN(const std::vector<std::string> arguments, without_masks(given));
  if (arguments.size() == 1 && is_take(arguments.front())) {
    NODAL_TRY_ASSIGN(RigPictures take, take_pictures(arguments.front(), options.take_sets));
    return by_data_sheet(std::move(take), words);
  }
  NODAL_TRY_ASSIGN(const Nominal nominal, nominal_of(words));
  RigPictures rig;
  rig.origin = RigPictures::Origin::kDataSheet;
  for (int h = 0; h < nominal.heads; ++h) rig.heads.push_back(fmt::format("cam{}", h));
  if (arguments.empty()) return fail(Errc::kMissingField, "no pictures; give one of each head");
  NODAL_TRY_ASSIGN(rig.sets, sets_of(arguments, options, rig.heads, rig.notes));
  NODAL_TRY(decode_all(rig.sets.front()));
  NODAL_TRY_ASSIGN(rig.calibration, nominal_rig(nominal, rig.frames(0)));
  NODAL_TRY(add_picture_masks(rig));
  return rig;
}

}  // namespace

std::string folder_per_head(std::size_t folders, std::size_t sets) {
  return fmt::format("{} folders: each has the pictures of one head, {} in each, sorted by name", folders, sets);
}

std::string folder_per_set(std::size_t folders, std::size_t heads) {
  return fmt::format("{} folders: each has one picture of each of the {} heads", folders, heads);
}

Result<RigPictures> by_data_sheet(RigPictures rig, const NominalWords& words) {
  NODAL_TRY_ASSIGN(const Nominal nominal, nominal_of(words));
  if (static_cast<std::size_t>(nominal.heads) != rig.heads.size()) {
    return fail(Errc::kBadValue, fmt::format("--nominal {}: it has {} heads, and the rig has {}; give --nominal "
                                             "{}x and the field of view",
                                             words.rig, nominal.heads, rig.heads.size(), rig.heads.size()));
  }
  NODAL_TRY(decode_all(rig.sets.front()));
  NODAL_TRY_ASSIGN(rig.calibration, nominal_rig(nominal, rig.frames(0)));
  for (std::size_t h = 0; h < rig.heads.size(); ++h) rig.calibration.heads[h].name = rig.heads[h];
  rig.origin = RigPictures::Origin::kDataSheet;
  return rig;
}

double FoundLens::may_be_wrong_percent() const { return std::ceil(100 * unsure); }

std::vector<std::vector<std::string>> RigPictures::files() const {
  std::vector<std::vector<std::string>> all;
  for (const std::vector<HeadPicture>& set : sets) {
    all.emplace_back();
    for (const HeadPicture& picture : set) all.back().push_back(picture.file());
  }
  return all;
}

registration::FrameSet RigPictures::frames(std::size_t set) const {
  registration::FrameSet views;
  for (const HeadPicture& picture : sets[set]) views.push_back(picture.pixels().view());
  return views;
}

std::vector<registration::FrameSet> RigPictures::frames() const {
  std::vector<registration::FrameSet> all;
  for (std::size_t set = 0; set < sets.size(); ++set) all.push_back(frames(set));
  return all;
}

Result<std::vector<std::vector<std::string>>> picture_files(const std::vector<std::string>& arguments,
                                                            const std::vector<std::string>& names) {
  std::vector<std::vector<std::string>> files;
  const auto is_folder = [](const std::string& name) {
    std::error_code error;
    return fs::is_directory(name, error);
  };
  if (are_sequences(arguments, names)) {
    return sequences_of(arguments, names);
  }
  if (std::ranges::any_of(arguments, is_folder)) {
    for (const std::string& argument : arguments) {
      if (!is_folder(argument)) {
        return fail(Errc::kBadValue, argument + " is not a folder; give either folders or pictures");
      }
      files.emplace_back();
      for (const std::string& name : names) {
        NODAL_TRY_ASSIGN(std::string file, picture_of(argument, name));
        files.back().push_back(std::move(file));
      }
    }
  } else {
    if (arguments.size() % names.size() != 0) {
      return fail(Errc::kBadValue, fmt::format("{} for {} heads; give one of each head, in the calibration's order, "
                                               "set after set, or folders with pictures named after the heads",
                                               counted(arguments.size(), "picture"), names.size()));
    }
    for (std::size_t k = 0; k < arguments.size(); ++k) {
      if (k % names.size() == 0) files.emplace_back();
      files.back().push_back(arguments[k]);
    }
  }
  return files;
}

Result<PictureSplit> split_of(const std::vector<std::string>& arguments, const SplitChoice& choice) {
  std::error_code error;
  if (!choice.find || arguments.size() != 1 || fs::is_directory(arguments.front(), error)) return choice.split;
  return find_circles(arguments.front());
}

Result<std::vector<std::vector<HeadPicture>>> split_pictures(const std::vector<std::string>& arguments,
                                                             const PictureSplit& split, std::size_t heads) {
  if (split.count() != heads) {
    return fail(Errc::kBadValue, fmt::format("{} pictures in a file ({}x{}) for {} heads; --split says how they are "
                                             "arranged",
                                             split.count(), split.columns, split.rows, heads));
  }
  std::vector<std::vector<HeadPicture>> sets;
  for (const std::string& argument : arguments) {
    std::vector<std::string> files{argument};
    std::error_code error;
    if (fs::is_directory(argument, error)) {
      NODAL_TRY_ASSIGN(PictureFolder inside, sequence_in(argument));
      files = std::move(inside.files);
    }
    for (const std::string& file : files) {
      sets.emplace_back();
      for (std::size_t n = 0; n < heads; ++n) sets.back().emplace_back(file, split, n);
    }
  }
  return sets;
}

Result<RigPictures> read_rig_pictures(const NominalWords& nominal, const std::vector<std::string>& arguments,
                                      const FileOptions& options) {
  if (!nominal.rig.empty()) return read_nominal_pictures(nominal, arguments, options);
  const std::string& file = arguments.front();
  NODAL_TRY_ASSIGN(CalibrationFile read, read_calibration_file(file));
  RigPictures rig;
  rig.origin = read.own ? RigPictures::Origin::kCalibration : RigPictures::Origin::kProject;
  rig.calibration = std::move(read.content.calibration);
  rig.notes = std::move(read.content.notes);
  rig.heads = names_of(rig.calibration);
  NODAL_TRY_ASSIGN(std::vector<std::string> pictures, without_masks({arguments.begin() + 1, arguments.end()}));
  const std::vector<std::string>& named = read.content.images;
  // Pictures that the command line names replace those of the project, which are then not looked for.
  if (pictures.empty() && std::ranges::none_of(named, &std::string::empty)) {
    NODAL_TRY_ASSIGN(FoundPictures found, project_pictures(file, named, options.places));
    pictures = std::move(found.files);
    std::ranges::move(found.notes, std::back_inserter(rig.notes));
  }
  if (pictures.empty()) {
    return fail(Errc::kMissingField,
                fmt::format("no pictures; give one for each of the {} heads of {}", rig.heads.size(), file));
  }
  if (pictures.size() == 1 && is_take(pictures.front())) {
    NODAL_TRY_ASSIGN(rig.sets, sets_of_take(pictures.front(), rig.heads, options.take_sets));
    return rig;
  }
  FileOptions files = options;
  if (rig.heads.size() < 2) files.split = {false, {}};
  NODAL_TRY_ASSIGN(rig.sets, sets_of(pictures, files, rig.heads, rig.notes));
  NODAL_TRY(add_picture_masks(rig));
  return rig;
}

Result<RigPictures> read_all_pictures(const NominalWords& nominal, const std::vector<std::string>& arguments,
                                      const FileOptions& options) {
  NODAL_TRY_ASSIGN(RigPictures rig, read_rig_pictures(nominal, arguments, options));
  const bool known = rig.origin != RigPictures::Origin::kDataSheet;
  for (std::vector<HeadPicture>& set : rig.sets) {
    NODAL_TRY(decode_all(set, known ? linear_heads(rig.calibration) : std::vector<bool>()));
  }
  return rig;
}

Result<std::vector<DecodedImage>> take_set(RigPictures& rig, std::size_t set, bool rgb) {
  std::vector<HeadPicture>& heads = rig.sets[set];
  NODAL_TRY(decode_all(heads, linear_heads(rig.calibration)));
  std::vector<DecodedImage> pictures;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const HeadCalibration& head = rig.calibration.heads[h];
    const DecodedImage& picture = heads[h].pixels();
    if (picture.width != head.width || picture.height != head.height) {
      return fail(Errc::kHeadMismatch,
                  fmt::format("{}: the picture has {}x{} pixels, and the calibration of head '{}' is for {}x{}; give "
                              "the pictures in the calibration's order and at the size they were calibrated at",
                              heads[h].file(), picture.width, picture.height, head.name, head.width, head.height));
    }
    pictures.push_back(heads[h].take());
  }
  const PixelFormat format = common_format(pictures, rgb);
  for (DecodedImage& picture : pictures) {
    if (picture.format != format) picture = in_format(std::move(picture), format);
  }
  return pictures;
}

}  // namespace nodal::host
