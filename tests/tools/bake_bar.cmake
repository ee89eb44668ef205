# Bakes a short bar with every optional block: cmake -D PROGRAM=… -D MAKE_BAR=… -D ASSET=… -P bake_bar.cmake
set(mesh ${ASSET}.mesh)
execute_process(COMMAND ${MAKE_BAR} 0.5 0.02 0.02 20 2 2 OUTPUT_FILE ${mesh} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${PROGRAM} ${mesh} --material steel --modes 12 --volume -o ${ASSET} COMMAND_ERROR_IS_FATAL ANY)
