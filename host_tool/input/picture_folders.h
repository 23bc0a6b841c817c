// Folders of pictures as people have them, with other files in them.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/picture_folder.h"
#include "protocol/base/result.h"

namespace nodal::media {
class PictureBytes;
}

namespace nodal::host {

/// Files that were opened to see whether they are pictures, so that their pixels need not open them again.
class OpenPictures {
 public:
  /// Opens the file, and keeps it open if it is a picture; of many files only the first kMaxOpen.
  /// Errors: those of read_picture_header().
  Result<ImageHeader> header_of(const std::string& file);
  /// Number of pictures in a file that is open: only the first one is read. 1 for a file that is not open.
  int count_pictures(const std::string& file) const;
  /// Null if the file is not open.
  std::shared_ptr<media::PictureBytes> take(const std::string& file);

 private:
  static constexpr std::size_t kMaxOpen = 64;  // a process may have 1024 files open
  std::map<std::string, std::shared_ptr<media::PictureBytes>> files_;
};

/// Whether a picture is said to be a sphere or a part of one (GPano), as results of Nodal and other programs are.
bool is_sphere(const ImageHeader& picture);

/// media::pictures_in() with every format that nodal reads.
Result<PictureFolder> pictures_in(const std::string& folder);

/// The same for heads' pictures, which stay open in `opened`. Spheres are left out: they are results of earlier runs.
Result<PictureFolder> head_pictures_in(const std::string& folder, OpenPictures& opened);

/// The same for a sequence, in which a missing picture would move all later ones to another set.
/// Errors: also those of the first file that is called like a picture and cannot be read.
Result<PictureFolder> sequence_in(const std::string& folder);

/// For every file that has the same bytes as another one with a shorter name, or an earlier one with a name as long:
/// its index and the other's.
std::vector<std::pair<std::size_t, std::size_t>> same_files(const std::vector<std::string>& files);

}  // namespace nodal::host
