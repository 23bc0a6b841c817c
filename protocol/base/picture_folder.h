// The pictures in a folder, as people have them: with other files among them.
#pragma once

#include <string>
#include <vector>

namespace nodal {

struct PictureFolder {
  std::vector<std::string> files;   ///< sorted by name
  std::string left_out;             ///< a whole sentence: the other files by kind, with what to do; may be empty
  std::vector<std::string> broken;  ///< files called like pictures that cannot be read as such
};

}  // namespace nodal
