// Folders of pictures as people have them, with other files in them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

/// A folder's pictures, and what else is in it.
struct FolderPictures {
  std::vector<std::string> files;   ///< sorted by name
  std::string left_out;             ///< a whole sentence: the other files by kind, with what to do; may be empty
  std::vector<std::string> broken;  ///< files called like pictures that cannot be read as such
};

/// Files that begin with a dot are left out without a word, folders in it with the sentence.
/// Errors: kIo when the folder cannot be read, kNotFound, with what is there instead, when no file in it is a picture.
Result<FolderPictures> pictures_in(const std::string& folder);

/// The same for a sequence, in which a missing picture would move all later ones to another set.
/// Errors: also those of the first file that is called like a picture and cannot be read.
Result<FolderPictures> sequence_in(const std::string& folder);

/// Whether a name ends like that of a picture, in any case.
bool named_like_a_picture(const std::string& file);

/// Whether a file holds pictures or a film in a format that is not read: what is given in place of a picture.
bool is_foreign_picture(const std::string& file);

/// For every file that has the same bytes as another one with a shorter name, or an earlier one with a name as long: its index
/// and the other's.
std::vector<std::pair<std::size_t, std::size_t>> same_files(const std::vector<std::string>& files);

}  // namespace nodal::host
