[
	"fileversion","20.5