// Folders of pictures as people have them, with other files in them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "protocol/base/picture_folder.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// media::pictures_in() with every format that nodal reads.
Result<PictureFolder> pictures_in(const std::string& folder);

/// The same for a sequence, in which a missing picture would move all later ones to another set.
/// Errors: also those of the first file that is called like a picture and cannot be read.
Result<PictureFolder> sequence_in(const std::string& folder);

/// Whether a file holds pictures or a film in a format that is not read: what is given in place of a picture.
bool is_foreign_picture(const std::string& file);

/// For every file that has the same bytes as another one with a shorter name, or an earlier one with a name as long: its index
/// and the other's.
std::vector<std::pair<std::size_t, std::size_t>> same_files(const std::vector<std::string>& files);

}  // namespace nodal::host
