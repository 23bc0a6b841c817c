// Heads whose film is in several files, one after another: chapters of a camera, or numbered pictures.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "host_tool/film/programs.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// The files of one head, in the order of time.
struct HeadFiles {
  std::string name;                ///< the folder's, or the first file's
  std::vector<std::string> files;  ///< absolute paths
  bool pictures = false;           ///< each is a frame
};

/// What the arguments of a command stand for, a head each: a film; chapters of GoPro's, which are put together by their
/// names (GX010042.MP4, GX020042.MP4); a folder with the chapters of any camera, in the order of their names, or with
/// numbered pictures.
/// Errors: kBadValue, naming the file, for a chapter or picture that is missing between two others, and for a folder
/// with films and pictures; kNotFound for a folder with neither.
Result<std::vector<HeadFiles>> files_of_heads(const std::vector<std::string>& inputs);

/// Width and height of a picture in a file, px.
struct PictureSize {
  int width = 0, height = 0;
  friend bool operator==(const PictureSize&, const PictureSize&) = default;
};
using SizeOfPicture = std::function<Result<PictureSize>(const std::string& file)>;

/// A file that ffmpeg's concat demuxer reads as one film, in `folder`; made unless it is there for the same files. It
/// names the files with what identifies them. `rate`: of pictures.
/// Errors: kHeadMismatch, naming the file, for one with another size, format or rate than the first; those of probe().
Result<std::string> make_list(const Programs& programs, const HeadFiles& head, int rate, const SizeOfPicture& size_of,
                              const std::string& folder);

/// Whether the path is that of such a list.
bool is_list(const std::string& path);

}  // namespace nodal::film
