# cmake -DFOLDER=viewer -DOUT=viewer_page.cpp -P embed.cmake: the page of the viewer as one constant.
foreach(part IN ITEMS page.html style.css three.js viewer.js)
  file(READ ${FOLDER}/${part} text_${part})
endforeach()
set(page "${text_page.html}")
foreach(part IN ITEMS style.css three.js viewer.js)
  string(FIND "${page}" "@${part}@" at)
  string(LENGTH "@${part}@" length)
  string(SUBSTRING "${page}" 0 ${at} before)
  math(EXPR after "${at} + ${length}")
  string(SUBSTRING "${page}" ${after} -1 rest)
  set(page "${before}${text_${part}}${rest}")
endforeach()
file(WRITE ${OUT} "#include <string_view>

namespace supple::scenes {

extern const std::string_view kViewerPage;
const std::string_view kViewerPage = R\"supple-page(${page})supple-page\";

}  // namespace supple::scenes
")
