// A cube as six files, one for each face, as editors and engines of games want them.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// The word for six files in the place of a layout.
inline constexpr std::string_view kFacesWord = "faces";
/// The layout that a row of the faces has.
inline constexpr std::string_view kFacesLayout = "cube_6x1";

inline constexpr std::size_t kFaces = 6;
/// In the order of kFacesLayout.
inline constexpr std::array<std::string_view, kFaces> kFaceNames{"right", "left", "up", "down", "front", "back"};

/// "dir/town.jpg", 0 -> "dir/town_right.jpg".
std::string face_file(const std::string& out, std::size_t face);

/// The files in the order of kFaceNames. Names end in the face's name or its first letter, after anything but a letter:
/// town_right.jpg, town-r.png. top and bottom are other words for up and down.
/// Errors: kBadValue for other numbers of files, for a name without a face, and for two files of one face.
Result<std::array<std::string, kFaces>> face_files(const std::vector<std::string>& files);

/// Six square pictures of one size and format, side by side. Errors: kBadValue with the face that differs.
Result<DecodedImage> row_of_faces(const std::array<DecodedImage, kFaces>& faces);

/// One of them.
DecodedImage face_of_row(const DecodedImage& row, std::size_t face);

}  // namespace nodal::host
