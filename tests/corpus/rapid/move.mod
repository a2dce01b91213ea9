MODULE m
CONST robtarget p1:=[[500,0,600.5],[0,0,1,0],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PERS tooldata t:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS wobjdata w:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PROC main()
MoveJ p1,v100,z10,t\WObj:=w;
MoveAbsJ [[0,10,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;
MoveL Offs(p1,0,0,10),v100,fine,t; ! up
ENDPROC
ENDMODULE
