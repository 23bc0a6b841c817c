// Folders of pictures as people have them, with other files in them.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "protocol/base/decoded_image.h"
#include "protocol/base/picture_folder.h"
#include "protocol/base/result.h"
#include "stitch/media/file_kind.h"

namespace nodal::media {

using HeaderReader = std::function<Result<ImageHeader>(const std::filesystem::path& file)>;

/// The pictures of a folder: the files whose header `header` reads. `tiff`: whether TIFFs, HEIF and
/// WebP files are among them. Files that begin with a dot and the pictures' masks (is_mask_name) are left out without a
/// word, folders in it with the sentence.
/// Errors: kIo when the folder cannot be read, kNotFound, with what is there instead, when no file in it is a picture.
Result<PictureFolder> pictures_in(const std::filesystem::path& folder, const HeaderReader& header, bool tiff);

/// The same for JPEGs and PNGs.
Result<PictureFolder> jpegs_and_pngs_in(const std::filesystem::path& folder);

/// Whether a file is a mask by its name: a.mask.png.
bool is_mask_name(std::string_view file);

/// Whether a name ends like that of a picture, in any case.
bool named_like_a_picture(std::string_view file);

/// Null for a JPEG, a PNG, a TIFF, and for a file that cannot be opened.
const FileKind* kind_of_file(const std::filesystem::path& file);

}  // namespace nodal::media
