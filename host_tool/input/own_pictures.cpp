#include "host_tool/input/own_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "host_tool/input/film_pictures.h"
#include "host_tool/input/matroska_film.h"
#include "host_tool/input/picture_folders.h"
#include "host_tool/input/picture_masks.h"
#include "host_tool/input/seen_part.h"
#include "host_tool/input/take_heads.h"
#include "host_tool/input/take_pictures.h"
#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/autocalibration/autocalibration.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/media/exif/exif.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/picture_folder.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

// How far real lenses are from their family, as a share of the distance from the axis.
constexpr double kFamilyUnsure = 0.05;

bool is_folder(const std::string& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

/// A name for a calibration that was found in pictures of these heads: "front and back", "a, b and 4 more".
std::string name_by_heads(const std::vector<std::string>& heads) {
  if (heads.size() == 2) return heads[0] + " and " + heads[1];
  return fmt::format("{}, {} and {} more", heads[0], heads[1], heads.size() - 2);
}

/// What decided which way is up, if it is not what the pictures show, and the option that corrects it.
std::string up_note(autocalibration::UpBasis basis) {
  std::string note;
  switch (basis) {
    case autocalibration::UpBasis::kEdges: return "";
    case autocalibration::UpBasis::kRing: note = "up is the axis of the ring that the heads form"; break;
    case autocalibration::UpBasis::kHeld: note = "up is how the pictures are held"; break;
    case autocalibration::UpBasis::kMajority: note = "up is how most of the pictures are held"; break;
    case autocalibration::UpBasis::kLight: note = "up is only guessed, by where the light comes from"; break;
  }
  return note +
         ", because vertical edges or a horizon are not seen all around. If the result is not upright, look in it for "
         "what should be up: how many degrees to the right of its middle (YAW) and above it (PITCH)? Then run the "
         "command again with --up YAW,PITCH";
}

/// `head`: the first placed one.
FoundLens lens_of(const autocalibration::Found& found, const HeadCalibration& head) {
  const autocalibration::LensEvidence& evidence = found.lens;
  const Result<geometry::Lens> lens = geometry::Lens::make(head.lens);
  const auto range = [&](double from, double to) {
    const auto degrees = [&](double px) {
      return lens ? lens->angle(px).value_or(lens->max_angle()) * kDegreesPerRadian : 0;
    };
    LensRange it{from * found.unit_px, to * found.unit_px, 0, 0};
    it.from_deg = degrees(it.from_px);
    it.to_deg = degrees(it.to_px);
    return it;
  };
  return {std::string(evidence.family),
          range(evidence.seen_from, evidence.seen_to),
          range(evidence.known_from, evidence.known_to),
          std::max(kFamilyUnsure, evidence.unsure),
          evidence.mostly(),
          evidence.whole(),
          ""};
}

std::string text_of(const LensRange& range) {
  return fmt::format("{:.0f}° to {:.0f}° from its axis ({:.0f} to {:.0f} px)", range.from_deg, range.to_deg,
                     range.from_px, range.to_px);
}

/// Empty if the lens is known everywhere.
std::string lens_note(const FoundLens& lens) {
  if (lens.whole || lens.family.empty()) return "";
  const std::string seen = fmt::format("because two pictures show the same only {}", text_of(lens.seen));
  const std::string advice = "Pictures that overlap more show more of it; or give its field of view: --nominal";
  if (lens.known.to_px <= lens.known.from_px) {
    return fmt::format("the lens is not known, {}; it is assumed to be {}. {}", seen, lens.family, advice);
  }
  return fmt::format(
      "the lens is known {}, {}; elsewhere it is assumed to be {}, and may be wrong by about {:.0f} % of the distance "
      "from its axis. {}",
      text_of(lens.known), seen, lens.family, lens.may_be_wrong_percent(), advice);
}

std::string why_left_out(const autocalibration::Misfit& misfit, const std::vector<std::string>& files) {
  const std::string& file = files[misfit.picture];
  if (misfit.cause == autocalibration::Misfit::Cause::kMirrored) {
    return fmt::format("it seems to be mirrored, because its mirror image fits {}; flip it (convert {} -flop FLIPPED)",
                       files[misfit.other], file);
  }
  return fmt::format(
      "it seems to be cropped, a panorama already, or taken with another zoom: its focal length is about {:.2g} times "
      "that of {}; "
      "give whole photographs of one zoom",
      misfit.focal_ratio, files[misfit.other]);
}

/// Takes copies of other files out of `files`, with a note each.
/// Errors: kBadValue when one file remains of several.
Status leave_out_copies(std::vector<std::string>& files, std::vector<std::string>& notes) {
  const auto same = same_files(files);
  if (!same.empty() && files.size() - same.size() < 2) {
    return fail(Errc::kBadValue, fmt::format("{} and {} are the same picture; give two or more that overlap",
                                             files[same.front().first], files[same.front().second]));
  }
  std::vector<bool> copy(files.size());
  for (const auto& [n, original] : same) {
    copy[n] = true;
    notes.push_back(fmt::format("{} is left out: it is the same picture as {}", files[n], files[original]));
  }
  std::size_t next = 0;
  std::erase_if(files, [&](const std::string&) { return copy[next++]; });
  return {};
}

/// Leaves only these heads in every set, in this order.
void keep_heads(RigPictures& rig, const std::vector<std::size_t>& places) {
  std::vector<std::string> names;
  for (const std::size_t place : places) names.push_back(std::move(rig.heads[place]));
  rig.heads = std::move(names);
  for (std::vector<HeadPicture>& set : rig.sets) {
    std::vector<HeadPicture> kept;
    for (const std::size_t place : places) kept.push_back(std::move(set[place]));
    set = std::move(kept);
  }
}

}  // namespace

std::vector<std::string> head_names(const std::vector<std::string>& paths) {
  std::vector<std::string> names, numbered;
  std::set<std::string> different;
  const auto plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-'; };
  bool good = true;
  for (const std::string& path : paths) {
    numbered.push_back(fmt::format("cam{}", names.size()));
    const fs::path whole = fs::path(path).lexically_normal();
    names.push_back((whole.has_filename() ? whole : whole.parent_path()).stem().string());
    good = good && !names.back().empty() && names.back().size() <= 64 && std::ranges::all_of(names.back(), plain) &&
           different.insert(names.back()).second;
  }
  return good ? names : numbered;
}

bool is_picture(const std::string& path) {
  // A folder is never a calibration, and a file that only claims to be a picture is refused as one.
  if (is_folder(path) || media::named_like_a_picture(path) || is_matroska(path)) return true;
  if (const media::FileKind* other = media::kind_of_file(path)) return other->pictures;
  Result<media::PictureBytes> file = media::PictureBytes::open(path);
  return file && read_picture_header(*file);
}

Result<RigPictures> own_pictures(const std::vector<std::string>& given, const SplitChoice& choice) {
  NODAL_TRY_ASSIGN(const std::vector<std::string> arguments, without_masks(given));
  if (arguments.empty()) return fail(Errc::kMissingField, "no pictures; give two or more that overlap");
  if (arguments.size() == 1 && is_take(arguments.front())) return take_pictures(arguments.front(), 1);
  OpenPictures opened;
  const bool picture = !is_folder(arguments.front()) && opened.header_of(arguments.front());
  if (!picture && are_films(arguments)) {
    RigPictures own;
    own.origin = RigPictures::Origin::kPictures;
    own.heads = head_names(arguments);
    NODAL_TRY_ASSIGN(own.sets, film_pictures(arguments, 1, own.notes));
    return own;
  }
  NODAL_TRY_ASSIGN(const PictureSplit split, split_of(arguments, choice));
  if (split.count() > 1) {
    RigPictures own;
    own.origin = RigPictures::Origin::kPictures;
    own.heads = part_names(split);
    NODAL_TRY_ASSIGN(own.sets, split_pictures(arguments, split, split.count()));
    if (choice.find) {
      own.notes.push_back(
          fmt::format("{} shows two circles: its halves, {} and {}, are taken for two pictures (--split "
                      "{}x{})",
                      arguments.front(), own.heads[0], own.heads[1], split.columns, split.rows));
    }
    return own;
  }
  const bool sequences = arguments.size() > 1 && std::ranges::all_of(arguments, is_folder);
  RigPictures own;
  own.origin = RigPictures::Origin::kPictures;
  std::vector<std::string> files;
  for (const std::string& argument : arguments) {
    if (!is_folder(argument)) {
      NODAL_TRY_ASSIGN(const ImageHeader header, opened.header_of(argument));
      if (arguments.size() > 1 && is_sphere(header)) {
        return fail(Errc::kBadValue, argument + ": this is a sphere already (GPano), and no head's picture; give the " +
                                         "pictures that it was made of");
      }
      files.push_back(argument);
      continue;
    }
    NODAL_TRY_ASSIGN(const PictureFolder found, sequences ? sequence_in(argument) : head_pictures_in(argument, opened));
    const std::vector<std::string>& inside = found.files;
    if (!found.left_out.empty()) own.notes.push_back(found.left_out);
    if (!sequences) {
      files.insert(files.end(), inside.begin(), inside.end());
      continue;
    }
    if (own.sets.empty()) own.sets.resize(inside.size());
    if (inside.size() != own.sets.size()) {
      return fail(
          Errc::kBadValue,
          fmt::format("{} has {} pictures, and {} has {}; several folders are taken for one head each, with a "
                      "picture of each set; if these are pictures of one sphere, give them as files, such as {}/*",
                      argument, inside.size(), arguments.front(), own.sets.size(), arguments.front()));
    }
    for (std::size_t n = 0; n < inside.size(); ++n) own.sets[n].emplace_back(inside[n]);
  }
  if (!sequences) {
    if (files.size() == 1) return fail(single_picture(files.front()));
    NODAL_TRY(leave_out_copies(files, own.notes));
    own.sets.resize(1);
    for (const std::string& file : files) {
      if (const int count = opened.count_pictures(file); count > 1) {
        own.notes.push_back(
            fmt::format("{} holds {} pictures, such as a burst, and only its main one is used; heif-convert takes the "
                        "others out",
                        file, count));
      }
      own.sets.front().emplace_back(file, opened.take(file));
    }
  }
  if (sequences) own.notes.push_back(folder_per_head(arguments.size(), own.sets.size()));
  own.heads = head_names(sequences ? arguments : files);
  if (own.heads.size() > kMaxCalibratedHeads) {
    return fail(Errc::kTooLarge, fmt::format("{} pictures, and at most {} can be placed together; leave some out: "
                                             "neighbours must still overlap by a third",
                                             own.heads.size(), kMaxCalibratedHeads));
  }
  return own;
}

Result<std::vector<std::size_t>> calibrate_by_pictures(RigPictures& rig, const UpChoice& up,
                                                       const OwnProgress& progress) {
  PointMatch match;
  match.set = rig.sets.size() / 2;
  std::vector<HeadPicture>& pictures = rig.sets[match.set];
  autocalibration::Options options;
  // Several pictures of one file are told apart by their heads.
  for (std::size_t n = 0; n < pictures.size(); ++n) {
    const std::string& file = pictures[n].file();
    const bool part = n > 0 && file == pictures[n - 1].file();
    const bool before = n + 1 < pictures.size() && file == pictures[n + 1].file();
    if (file.empty()) options.files.push_back("head '" + rig.heads[n] + "'");
    else options.files.push_back(file + (part || before ? ", " + rig.heads[n] : ""));
  }
  const std::vector<std::string>& files = options.files;
  NODAL_TRY(decode_all(pictures, {}, [&](std::size_t n) {
    progress(0.3 * static_cast<double>(n) / static_cast<double>(files.size()), "reading " + files[n]);
  }));
  std::vector<DecodedImage> grey;
  std::vector<std::string> turned, outdated;
  for (const HeadPicture& picture : pictures) {
    const DecodedImage& image = picture.pixels();
    grey.push_back(media::convert_image(image.view(), PixelFormat::kGrey8));
    std::optional<double> focal_px;
    if (picture.focal_35mm()) {
      focal_px = *picture.focal_35mm() / media::kFilmDiagonalMm * std::hypot(image.width, image.height);
    }
    options.focal_px.push_back(focal_px);
    const auto [x, y] = up_in(picture);
    options.up.emplace_back(x, y);
    if (media::is_outdated(picture.orientation(), image.width, image.height)) outdated.push_back(picture.file());
    else if (picture.orientation() != 1) turned.push_back(picture.file());
  }
  NODAL_TRY_ASSIGN(std::vector<HeadMask> masks, find_masks(rig.sets, rig.heads, match.set));
  if (const std::string note = describe(masks, rig.heads); !note.empty()) rig.notes.push_back(note);
  for (HeadMask& mask : masks) options.masks.push_back(std::move(mask.polygons));
  options.progress = [&](double done) { progress(0.3 + 0.7 * done, "matching the pictures"); };
  NODAL_TRY_ASSIGN(autocalibration::Found found, autocalibration::autocalibrate(grey, rig.heads, options));
  rig.calibration = std::move(found.calibration);
  std::vector<std::string> placed;
  for (const std::size_t n : found.placed) placed.push_back(files[n]);
  for (std::size_t n = 0; n < files.size(); ++n) {
    if (std::ranges::find(found.placed, n) != found.placed.end()) continue;
    const auto misfit = std::ranges::find(found.misfits, n, &autocalibration::Misfit::picture);
    rig.notes.push_back(misfit == found.misfits.end()
                            ? files[n] +
                                  " is left out: too few of its points were found in the other pictures; take "
                                  "one more picture between it and its neighbour"
                            : files[n] + " is left out: " + why_left_out(*misfit, files));
  }
  if (!outdated.empty()) {
    rig.notes.push_back(
        fmt::format("{} of {} pictures are marked as turned (Exif orientation) although they are higher than wide, {} "
                    "first: a program turned them and left the mark, so they are taken as the file stores them",
                    outdated.size(), files.size(), outdated.front()));
  }
  if (!turned.empty()) {
    rig.notes.push_back(
        fmt::format("{} of {} pictures are marked as turned (Exif orientation), {} first; their pixels are used as the "
                    "file stores them, and the calibration is for those",
                    turned.size(), files.size(), turned.front()));
  }
  for (const auto& [a, b] : found.doubtful) {
    rig.notes.push_back(
        fmt::format("{} and {} overlap, but what they show there does not line up: one of them may be turned by some "
                    "degrees, or they see near things from different places",
                    placed[a], placed[b]));
  }
  match.points = std::make_shared<const std::vector<autocalibration::Match>>(std::move(found.points));
  match.lens = lens_of(found, rig.calibration.heads.front());
  match.lens.note = lens_note(match.lens);
  if (!match.lens.note.empty()) {
    rig.notes.push_back(match.lens.note);
    rig.calibration.comment = "Lens and rotations from the pictures alone: " + match.lens.note + ".";
  }
  match.confidence = fmt::format(
      "{} of {} pictures placed: {} points were found in two pictures each, and half of them agree within {:.1f} px",
      placed.size(), files.size(), found.matches, found.error_px);
  match.placed = placed.size();
  match.given = files.size();
  match.point_count = found.matches;
  match.median_px = found.error_px;
  rig.match = std::move(match);
  keep_heads(rig, found.placed);
  rig.calibration.name = name_by_heads(rig.heads);
  const std::string note = up_note(found.up);
  if (up.kind == UpChoice::Kind::kAuto && !note.empty()) rig.notes.push_back(note);
  NODAL_TRY(turn_to_middle(rig.calibration));
  NODAL_TRY(turn_up(rig, up));
  return std::move(found.placed);
}

}  // namespace nodal::host
