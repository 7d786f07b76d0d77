# Run at every build (cmake -P): writes OUTPUT from TEMPLATE only when the commit or its cleanliness changed.
execute_process(COMMAND git -C ${SOURCE} rev-parse --short=10 HEAD OUTPUT_VARIABLE hash
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
execute_process(COMMAND git -C ${SOURCE} status --porcelain --untracked-files=no OUTPUT_VARIABLE changes ERROR_QUIET)
if(NOT hash)
  set(GIT_DESCRIPTION "no git")
elseif(changes)
  set(GIT_DESCRIPTION "${hash}, modified")
else()
  set(GIT_DESCRIPTION "${hash}, clean")
endif()
configure_file(${TEMPLATE} ${OUTPUT} @ONLY)
